#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "train/generator_gradients.h"

namespace stymo {

/// Names, in stats.jsonl, of the values that the discriminator's updates record: the loss, the mean
/// logits of photos and of rendered images, the mean sign of the photos' logits, the augmentation
/// probability, and R1, E |dD/dx|^2 / 2 without gamma.
inline constexpr std::array<std::string_view, 6> discriminator_loss_names{
    "discriminator", "real_logit", "fake_logit", "real_sign", "augmentation", "r1"};

/// One micro-batch of the discriminator's update: photos on black against the generator's images of
/// the same faces, into which no gradient flows. Losses are means over the micro-batch; `total` is
/// the loss. `jitter` as in generator_gradients. The images are rendered one face at a time.
/// Freezing the model's parameters avoids recording graphs that are not needed. Throws ShapeError
/// for a batch without images of the phase's resolution. The gradients go to `sink`, if there is
/// one.
[[nodiscard]] LossAndGradients discriminator_gradients(const GeneratorInputs& inputs,
                                                       const TrainingPosition& position,
                                                       const FaceBatch& batch,
                                                       const std::vector<Parameter>& parameters,
                                                       Rng& jitter, const GradientSink& sink = {});

/// One micro-batch of R1: gradients of `weight` * E |dD/dx|^2 / 2 on the real photos; `total` is
/// the penalty without its weight. dD/dx is taken with respect to the photos before augmentation.
/// Errors and `sink` as in discriminator_gradients.
[[nodiscard]] LossAndGradients r1_gradients(const Discriminator& discriminator,
                                            const TrainingPosition& position,
                                            const FaceBatch& batch, double weight,
                                            const std::vector<Parameter>& parameters,
                                            std::span<const ImageAugmentation> augmentations = {},
                                            const GradientSink& sink = {});

}  // namespace stymo
