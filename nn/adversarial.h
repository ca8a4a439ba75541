#pragma once

#include <functional>

#include "core/autograd/variable.h"

/// Losses of adversarial training on logits (B, 1), means over the batch (Goodfellow et al. 2014,
/// Mescheder et al. 2018).
namespace stymo {

/// E softplus(-D(fake)), non-saturating.
[[nodiscard]] Variable generator_loss(const Variable& fake_logits);
/// The discriminator's loss is E softplus(-D(real)) + E softplus(D(fake)). Two functions, so that
/// the graph of one term can be let go before the other is computed.
[[nodiscard]] Variable real_loss(const Variable& real_logits);
[[nodiscard]] Variable fake_loss(const Variable& fake_logits);
/// E |dD/dx|^2 / 2 on real images, a sum over pixels and channels and a mean over the batch, by
/// exact double backward: its gradient with respect to D's parameters is that of the value.
/// `discriminator` maps images to logits.
[[nodiscard]] Variable r1_penalty(const std::function<Variable(const Variable&)>& discriminator,
                                  const Tensor& real_images);

/// An image that fades from its half resolution (box down, nearest up) to itself: what a
/// discriminator sees while a block is faded in. The image itself at fade = 1. Throws ValueError
/// for a fade outside [0, 1], ShapeError for an odd side.
[[nodiscard]] Variable faded_image(const Variable& images, double fade);

}  // namespace stymo
