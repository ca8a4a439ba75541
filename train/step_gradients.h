#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "core/autograd/grad.h"
#include "nn/image_augmentation.h"
#include "train/loss_terms.h"
#include "train/photo_offsets.h"

namespace stymo {

struct LossAndGradients {
    LossValues losses;
    /// One for each of `parameters`, in their order; empty if a sink received them.
    std::vector<Variable> gradients;
};

/// Passes the gradients of y to the sink one by one (grad_in_turn), or returns all of them if there
/// is no sink.
[[nodiscard]] std::vector<Variable> gradients_for(const GradientSink& sink, const Variable& y,
                                                  std::span<const Variable> xs);

/// Inputs of an update of the generator (encoder and decoder) or of the discriminator.
struct GeneratorInputs {
    const Model& model;
    const ReconstructionLoss& reconstruction;
    const TrainConfig& config;
    const PhotoOffsets* offsets = nullptr;  ///< learnt offsets of the photos; null: none
    /// Required in the second stage, unless its loss has weight 0.
    const Discriminator* discriminator = nullptr;
    /// Augmentations of the images that the discriminator sees: one for each rendered image, or, in
    /// the discriminator's own update, one for each photo and then one for each rendered image.
    /// Empty: no augmentation.
    std::span<const ImageAugmentation> augmentations{};
    /// Codes of the batch's faces, which the second stage keeps as constants; null: they are
    /// computed (face_codes).
    const Codes* codes = nullptr;
    /// Required by a weight of identity.
    const IdentityNetwork* identity = nullptr;
};

/// Forward and backward pass of the generator's update on one micro-batch, in either stage: codes,
/// decoder with stratified samples, the terms of loss_terms.h. The losses are means over the images
/// of the micro-batch. In the second stage codes and discriminator are constants; freezing the
/// discriminator's parameters saves memory and does not change the gradients. `jitter` advances by
/// the same amount for each image, so that consecutive micro-batches draw the same numbers as one
/// large batch. The gradients go to `sink`, if there is one.
[[nodiscard]] LossAndGradients generator_gradients(const GeneratorInputs& inputs,
                                                   const TrainingPosition& position,
                                                   const FaceBatch& batch,
                                                   const std::vector<Parameter>& parameters,
                                                   Rng& jitter, const GradientSink& sink = {});

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
