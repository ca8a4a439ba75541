#pragma once

#include <vector>

#include "nn/models/model.h"
#include "nn/models/reconstruction.h"
#include "train/batch.h"
#include "train/face_codes.h"
#include "train/train_config.h"

namespace stymo {

/// The terms of a stage's loss on encoder and decoder, each without its weight, and their weighted sum.
struct LossTerms {
    double total = 0.0;
    double reconstruction = 0.0;  ///< L_recon, weighted as in equation (recon)
    double photometric = 0.0;     ///< without its weight, as all that follow
    double perceptual = 0.0;
    double adversarial = 0.0;  ///< second stage
    double code = 0.0;         ///< L_code with its group weights
    double mask = 0.0;
    double opacity = 0.0;
    double depth_variance = 0.0;
    double code_norm = 0.0;

    /// Adds `part` of another batch's terms.
    void accumulate(const LossTerms& other, double part);
};

struct LossAndGradients {
    LossTerms losses;
    std::vector<Variable> gradients;  ///< one for each of `parameters`, in their order
};

/// Adds the terms that both stages have to `total` and notes them in `report`: reconstruction, mask loss if `with_mask`, opacity,
/// depth variance.
void add_common_terms(Variable& total, LossTerms& report, const ReconstructionLoss::Terms& terms, const Decoded& decoded,
                      const TrainingBatch& batch, bool with_mask, const LossConfig& weights);

/// Forward and backward pass of the first stage on one micro-batch: encoder, decoder with stratified samples, loss.
/// `mask_loss` says whether the mask term is on yet. The loss is a mean over the images of the batch. `jitter` moves on by as
/// much for each image, so that several micro-batches in a row draw what one batch of all their images would. `offsets`: of the
/// faces' codes, if they learn any.
[[nodiscard]] LossAndGradients reconstruction_gradients(const Model& model, const ReconstructionLoss& reconstruction,
                                                        const TrainingBatch& batch, const TrainConfig& config,
                                                        const std::vector<Parameter>& parameters, bool mask_loss, Rng& jitter,
                                                        const CodeOffsets* offsets = nullptr);

}  // namespace stymo
