#pragma once

#include <array>
#include <cstdint>

/// The linear maps of Winograd's F(4x4, 3x3) on pixels with many channels. Each map transforms a
/// square of pixels to another square, along columns and then along rows. Channels are independent
/// and contiguous; their number is a multiple of 16. A square is given either as pointers to the
/// channels of each pixel, or as a start and the stride between its elements.
namespace stymo::kernels {

inline constexpr std::int64_t winograd_tile = 4;   ///< side of a square of output pixels
inline constexpr std::int64_t winograd_patch = 6;  ///< side of the input pixels that it depends on
/// Multiplications for each tile and pair of channels.
inline constexpr std::int64_t winograd_elements = 36;

using PatchPixels = std::array<const float*, 36>;
using TilePixels = std::array<float*, 16>;
using ConstTilePixels = std::array<const float*, 16>;

/// B^T d B, from a patch.
void winograd_transform_patch(const PatchPixels& patch, float* elements,
                              std::int64_t element_stride, std::int64_t channels);
/// The same for a patch whose values are first multiplied by `slope` where `signs` is not positive.
void winograd_transform_gated_patch(const PatchPixels& patch, const PatchPixels& signs, float slope,
                                    float* elements, std::int64_t element_stride,
                                    std::int64_t channels);
/// leaky_relu(A^T m A + bias, slope), to a tile of outputs.
void winograd_transform_products(const float* elements, std::int64_t element_stride,
                                 const float* bias, float slope, const TilePixels& tile,
                                 std::int64_t channels);
/// A g A^T, from a tile of the outputs' gradients: the adjoint of A^T m A.
void winograd_transform_tile(const ConstTilePixels& tile, float* elements,
                             std::int64_t element_stride, std::int64_t channels);
/// Destination of one matrix row for each element: panels of `panel_width` channels, `panel_stride`
/// elements apart.
struct PanelRows {
    float* first;
    std::int64_t element_stride;
    std::int64_t panel_width;
    std::int64_t panel_stride;
};
/// G w G^T, from nine taps (3, 3, channels). `turned`: the filter is first rotated by 180 degrees.
void winograd_transform_filter(const float* taps, bool turned, const PanelRows& rows,
                               std::int64_t channels);
/// G^T m G, to nine taps: the adjoint of G w G^T.
void winograd_transform_to_filter(const float* elements, std::int64_t element_stride, float* taps,
                                  std::int64_t channels);

}  // namespace stymo::kernels
