#pragma once

#include <array>
#include <functional>
#include <span>

#include "core/autograd/variable.h"
#include "nn/models/codes.h"

/// Losses. Targets of the reconstruction are constants of the same element type as the images.
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

// Losses of adversarial training on logits (B, 1), means over the batch (Goodfellow et al. 2014,
// Mescheder et al. 2018).

/// E softplus(-D(fake)), non-saturating.
[[nodiscard]] Variable generator_loss(const Variable& fake_logits);
/// The discriminator's loss is E softplus(-D(real)) + E softplus(D(fake)). It has two functions, so
/// that the graph of one term can be released before the other is computed.
[[nodiscard]] Variable real_loss(const Variable& real_logits);
[[nodiscard]] Variable fake_loss(const Variable& fake_logits);
/// R1 without its weight: E |dD/dx|^2 / 2 on real images, summed over pixels and channels and
/// averaged over the batch. Its gradient with respect to D's parameters is exact (double backward).
/// `discriminator` maps images to logits.
[[nodiscard]] Variable r1_penalty(const std::function<Variable(const Variable&)>& discriminator,
                                  const Tensor& real_images);

/// A mixture of an image, with weight `fade`, and its half resolution (box filter down, nearest
/// neighbour up). A discriminator sees it while a block is being faded in. At fade = 1 it is the
/// image itself. Throws ValueError for a fade outside [0, 1], ShapeError for an odd side.
[[nodiscard]] Variable faded_image(const Variable& images, double fade);

}  // namespace stymo
