#pragma once

#include <vector>

#include "nn/models/discriminator.h"
#include "nn/models/model.h"
#include "nn/models/reconstruction.h"
#include "train/batch.h"
#include "train/reconstruction_stage.h"
#include "train/train_config.h"

namespace stymo {

/// Where the second stage stands.
struct AdversarialPhase {
    std::int64_t resolution = 64;  ///< of what is rendered and judged
    double fade = 1.0;             ///< of this resolution's block in the discriminator
    std::int64_t samples_per_ray = 64;
};

struct DiscriminatorTerms {
    double loss = 0.0;
    double real_logit = 0.0;  ///< mean
    double fake_logit = 0.0;
    double r1 = 0.0;  ///< E |dD/dx|^2 / 2, without gamma; 0 in steps without it

    void accumulate(const DiscriminatorTerms& other, double part);
};

struct DiscriminatorGradients {
    DiscriminatorTerms losses;
    std::vector<Variable> gradients;  ///< one for each of `parameters`, in their order
};

/// One micro-batch of the discriminator's update: real photos on black against the generator's pictures of the same faces, which
/// no gradient flows into. Means over the micro-batch. `jitter` as in reconstruction_gradients. The pictures are rendered one
/// face at a time; a model whose parameters are frozen meanwhile saves the graph that is otherwise made and dropped for each of
/// them. Throws ShapeError for a batch without pictures of the phase's resolution.
[[nodiscard]] DiscriminatorGradients discriminator_gradients(const Model& model, const Discriminator& discriminator,
                                                             const TrainingBatch& batch, const AdversarialPhase& phase,
                                                             const std::vector<Parameter>& parameters, Rng& jitter,
                                                             const CodeOffsets* offsets = nullptr);

/// One micro-batch of R1: gradients of `weight` * E |dD/dx|^2 / 2 on the real photos. Throws as discriminator_gradients.
[[nodiscard]] DiscriminatorGradients r1_gradients(const Discriminator& discriminator, const TrainingBatch& batch,
                                                  const AdversarialPhase& phase, double weight,
                                                  const std::vector<Parameter>& parameters);

/// One micro-batch of the generator's update: reconstruction up to the phase's resolution, mask loss, opacity, depth variance,
/// non-saturating adversarial loss with its weight. The faces' codes are constants, and so is the discriminator; there is no
/// code loss. Without adversarial weight the discriminator is not run and may be null. A discriminator whose parameters are
/// frozen meanwhile takes less memory for the same gradients. The mask loss needs `mask_loss` and the model's own resolution.
[[nodiscard]] LossAndGradients generator_gradients(const Model& model, const Discriminator* discriminator,
                                                   const ReconstructionLoss& reconstruction, const TrainingBatch& batch,
                                                   const AdversarialPhase& phase, const TrainConfig& config,
                                                   const std::vector<Parameter>& parameters, bool mask_loss, Rng& jitter,
                                                   const CodeOffsets* offsets = nullptr);

}  // namespace stymo
