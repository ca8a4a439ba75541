#pragma once

#include <array>
#include <span>

#include "core/autograd/variable.h"
#include "nn/models/codes.h"

/// Losses of the reconstruction. Targets are constants of the same element type as the images.
/// Where `known` (nn/known_pixels.h) is 0, a pixel contributes 0 to the mean over all pixels, so
/// that the others weigh as much as without it.
namespace stymo {

/// The paper's L_photo: sum_r weights_r mean |image_r - target_r| over the resolutions r, a scalar;
/// the mean is over all elements. Weights beyond the last image are ignored. Throws ShapeError for
/// an image without a target or a weight, or of another shape than its target.
[[nodiscard]] Variable photometric_loss(std::span<const Variable> images,
                                        std::span<const Tensor> targets,
                                        std::span<const double> weights);

/// The paper's L_code: sum_g weights_g |z_g - target_g|^2, a sum over the elements of a code and a
/// mean over the batch. `present` (B) is 1 where a face has target codes, else 0. A face without
/// target codes contributes 0 to the mean over all B faces.
[[nodiscard]] Variable code_loss(const Codes& z, const std::array<Tensor, 4>& targets,
                                 std::span<const double, 4> weights, const Tensor& present);

/// The paper's L_seg: mean binary cross-entropy of logits against a mask of the same shape in [0,
/// 1].
[[nodiscard]] Variable mask_loss(const Variable& logit, const Tensor& mask,
                                 const Tensor& known = {});

/// Mean binary cross-entropy of the opacity 1 - transmittance of each ray against a mask in [0, 1]
/// with as many elements, like `known`. In the logarithms 1e-3 is added to opacity and
/// transmittance, which bounds the gradient. Unlike the gradient of a squared difference, it does
/// not vanish for an opaque ray of the background until the transmittance is as small as 1e-3.
[[nodiscard]] Variable opacity_loss(const Variable& transmittance, const Tensor& mask,
                                    const Tensor& known = {});

/// Mean of |depth - target| over the rays that `present` (0 or 1) selects, 0 if it selects none.
/// All three have the same number of elements. Throws ShapeError otherwise.
[[nodiscard]] Variable depth_loss(const Variable& depth, const Tensor& target,
                                  const Tensor& present);

/// Mean of each image and channel weighted by a mask in [0, 1]: images (B, H, W, C) and mask (B, H,
/// W, 1) -> (B, 1, 1, C). For an empty mask the mean and its gradient are 0. Throws ShapeError for
/// other shapes.
[[nodiscard]] Variable masked_mean(const Variable& images, const Tensor& mask);

}  // namespace stymo
