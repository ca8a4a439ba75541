#pragma once

#include <cstdint>

#include "core/autograd/variable.h"

/// Unknown pixels of photos: they lie outside the photo, or something covers the face there. They
/// take part in no loss, no metric and no colour. A tensor `known` has the shape (..., H, W, 1) and
/// is 1 where a pixel is known, else 0. An undefined one stands for ones, and costs nothing.
namespace stymo {

/// The known pixels of (H, W, 1) or (B, H, W, 1) at another size: those to which no unknown pixel
/// contributes when images are resampled (resize_bicubic).
[[nodiscard]] Tensor known_at(const Tensor& known, std::int64_t height, std::int64_t width);

/// `images` where pixels are known, else `other`, which broadcasts to them. No gradient flows to
/// what is not taken.
[[nodiscard]] Variable where_known(const Tensor& known, const Variable& images,
                                   const Variable& other);
/// The same with one number for all unknown pixels.
[[nodiscard]] Variable where_known(const Tensor& known, const Variable& images, double other);

/// (B, S, S, C) with a guess in place of unknown pixels, which depends on the known ones alone: the
/// pixel of the mirror image, since aligned faces are nearly symmetric, else the mean of known
/// pixels around. For networks that must see something.
[[nodiscard]] Tensor with_guesses(const Tensor& known, const Tensor& images);

/// Share of the pixels that is known.
[[nodiscard]] double known_share(const Tensor& known);
/// `known`, or an undefined tensor if all of its pixels are.
[[nodiscard]] Tensor unless_all_known(const Tensor& known);

}  // namespace stymo
