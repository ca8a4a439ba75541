#pragma once

#include <functional>

#include "core/autograd/variable.h"

/// Losses of adversarial training on logits (B, 1), means over the batch (Goodfellow et al. 2014,
/// Mescheder et al. 2018).
namespace stymo {

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
