#pragma once

#include <array>
#include <span>

#include "core/autograd/variable.h"
#include "nn/models/codes.h"

/// Losses of the reconstruction, all scalars. Targets are constants of the images' type.
namespace stymo {

/// sum_r weights_r mean |image_r - target_r|, over the resolutions of the paper's L_photo; the mean
/// is over all elements. Weights of resolutions beyond the last image are left unused. Throws
/// ShapeError for images without a target or weight, or of another shape than their target.
[[nodiscard]] Variable photometric_loss(std::span<const Variable> images,
                                        std::span<const Tensor> targets,
                                        std::span<const double> weights);

/// The paper's L_code: sum_g weights_g |z_g - target_g|^2, a sum over the elements of a code and a
/// mean over the batch. `present` (B): 1 where a face has target codes, 0 where it has none; a face
/// without them adds 0 to the mean over all B.
[[nodiscard]] Variable code_loss(const Codes& z, const std::array<Tensor, 4>& targets,
                                 std::span<const double, 4> weights, const Tensor& present);

/// The paper's L_seg: mean binary cross-entropy of logits against a mask of the same shape in [0,
/// 1].
[[nodiscard]] Variable mask_loss(const Variable& logit, const Tensor& mask);

/// Mean binary cross-entropy of the opacity 1 - transmittance of each ray against a mask in [0, 1]
/// with as many elements. Opacity and transmittance are lifted by 1e-3 in the logarithms, which
/// bounds the gradient; unlike with a squared difference, it does not fade for an opaque ray of the
/// background until its transmittance is that small.
[[nodiscard]] Variable opacity_loss(const Variable& transmittance, const Tensor& mask);

/// Mean of each image and channel under a mask in [0, 1], the colour of a part: images (B, H, W, C)
/// and mask (B, H, W, 1) -> (B, 1, 1, C). Under an empty mask the mean is 0, and so is its
/// gradient.
[[nodiscard]] Variable masked_mean(const Variable& images, const Tensor& mask);

}  // namespace stymo
