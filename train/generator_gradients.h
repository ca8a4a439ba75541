#pragma once

#include <span>
#include <vector>

#include "core/autograd/grad.h"
#include "nn/image_augmentation.h"
#include "train/code_offsets.h"
#include "train/loss_terms.h"

namespace stymo {

struct LossAndGradients {
    LossValues losses;
    /// One for each of `parameters`, in their order; none where a sink took them.
    std::vector<Variable> gradients;
};

/// Hands the gradients of y to the sink in turn, or returns all of them where there is no sink.
[[nodiscard]] std::vector<Variable> gradients_for(const GradientSink& sink, const Variable& y,
                                                  std::span<const Variable> xs);

/// What an update of the generator, that is of encoder and decoder, computes with.
struct GeneratorInputs {
    const Model& model;
    const ReconstructionLoss& reconstruction;
    const TrainConfig& config;
    const CodeOffsets* offsets = nullptr;          ///< of the faces' codes, if they learn any
    const Discriminator* discriminator = nullptr;  ///< needed in the second stage, unless its loss
                                                   ///< has no weight
    /// Of the images that the discriminator sees: of each rendered one, or, in the discriminator's
    /// own update, of each photo, then of each rendered one. Empty: it sees them as they are.
    std::span<const ImageAugmentation> augmentations{};
};

/// Forward and backward pass of the generator's update on one micro-batch, in either stage: codes,
/// decoder with stratified samples, the terms of loss_terms.h. The losses are means over the images
/// of the micro-batch. In the second stage the codes are constants; so is the discriminator, and
/// one whose parameters are frozen meanwhile takes less memory for the same gradients. `jitter`
/// moves on by as much for each image, so that several micro-batches in a row draw what one batch
/// of all their images would. The gradients go to `sink`, if there is one.
[[nodiscard]] LossAndGradients generator_gradients(const GeneratorInputs& inputs,
                                                   const TrainingPosition& position,
                                                   const FaceBatch& batch,
                                                   const std::vector<Parameter>& parameters,
                                                   Rng& jitter, const GradientSink& sink = {});

}  // namespace stymo
