#pragma once

#include <span>

#include "core/autograd/variable.h"
#include "core/resample_matrix.h"

/// Linear resampling of images (batch, height, width, channels). Every filter here (FIR up- and
/// downsampling, blur, bilinear, antialiased bicubic) is a sparse matrix for the rows and one for
/// the columns. The adjoint is the resampling with the two transposed matrices, so one op provides
/// derivatives of any order.
namespace stymo {

/// vertical * x * horizontal^T in every channel. Throws ShapeError unless the matrices have the
/// image's height and width as input lengths.
[[nodiscard]] Variable resample(const Variable& x, const ResampleMatrix& vertical,
                                const ResampleMatrix& horizontal);

/// One axis of upfirdn: insert up-1 zeros after every element, pad with zeros, convolve with the
/// filter (as in StyleGAN2), keep every down-th element. Throws ValueError for an up, a down or a
/// number of taps below 1, ShapeError if the filter is longer than the padded axis.
[[nodiscard]] ResampleMatrix upfirdn_matrix(int input_length, std::span<const double> filter,
                                            int up, int down, int pad_before, int pad_after);
/// The filter [1,2,1]/4 with the same length and the border mirrored (the edge itself not
/// repeated).
[[nodiscard]] ResampleMatrix blur_matrix(int length);
/// Half-pixel centres, edges clamped, no antialiasing.
[[nodiscard]] ResampleMatrix bilinear_matrix(int output_length, int input_length);
/// Cubic convolution with a = -0.5, widened by the scale when shrinking, with weights normalised at
/// the borders. Equals Pillow and PyTorch with antialias.
[[nodiscard]] ResampleMatrix bicubic_matrix(int output_length, int input_length);
/// Mean of blocks. Throws ShapeError unless output_length divides input_length.
[[nodiscard]] ResampleMatrix box_matrix(int output_length, int input_length);

/// upfirdn_matrix on both axes.
[[nodiscard]] Variable upfirdn2d(const Variable& x, std::span<const double> filter, int up,
                                 int down, int pad_before, int pad_after);
[[nodiscard]] Variable blur(const Variable& x);
[[nodiscard]] Variable resize_bilinear(const Variable& x, int height, int width);
/// Antialiased bicubic; results may exceed the input's range.
[[nodiscard]] Variable resize_bicubic(const Variable& x, int height, int width);
[[nodiscard]] Variable resize_box(const Variable& x, int height, int width);

/// (b, h, w, 4c) -> (b, 2h, 2w, c): channel 4c + 2i + j goes to row 2h + i, column 2w + j.
[[nodiscard]] Variable pixel_shuffle(const Variable& x);
/// pixel_shuffle plus the nearest-neighbour upsampling of `coarse` (b, h, w, c), in one pass.
[[nodiscard]] Variable pixel_shuffle_onto(const Variable& coarse, const Variable& x);
/// The inverse of pixel_shuffle.
[[nodiscard]] Variable pixel_unshuffle(const Variable& x);

/// Learnt upsampling of an image: nearest-neighbour upsampling plus detail, blurred by [1, 2, 1] /
/// 4 along both axes with mirrored border. x (B, h, w, C) and detail (B, h, w, 4 C) -> (B, 2h, 2w,
/// C). Channel (2 i + j) C + c of the detail belongs to channel c at row i, column j of the
/// upsampled pixel. Saves nothing for the backward pass. Throws ShapeError for other extents.
[[nodiscard]] Variable blur_upsampled(const Variable& x, const Variable& detail);
/// The same as a composition of ops: the reference implementation, which is also used for float64.
[[nodiscard]] Variable blur_upsampled_reference(const Variable& x, const Variable& detail);

}  // namespace stymo
