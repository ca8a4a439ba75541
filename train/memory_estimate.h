#pragma once

#include <cstdint>

#include "nn/models/reconstruction.h"
#include "train/schedule.h"
#include "train/train_config.h"

namespace stymo {

/// What the backward pass computes once more instead of keeping it, as in DecodeOptions.
struct Recomputation {
    bool blocks = false;  ///< the render blocks, image by image
    bool field = false;   ///< the field, tile by tile
};

/// How the micro-batches of a step are computed.
struct StepExecution {
    Recomputation recomputation;
    bool side_by_side = false;  ///< one on each thread, where there are as many (train/stage.h)

    /// Micro-batches of this phase that are computed at the same time.
    [[nodiscard]] std::int64_t at_once(const TrainingPhase& phase) const;
};

/// Estimated peak of one training step, in bytes: what lasts from step to step, and what each part
/// of the step needs beyond it for the micro-batches that are computed at once. The parts follow
/// one another.
struct StepMemory {
    std::int64_t lasting = 0;        ///< weights, their gradients, the optimisers' moments, EMA
    std::int64_t generator = 0;      ///< encoder, decoder and losses, forward and backward
    std::int64_t discriminator = 0;  ///< 0 in the first stage
    std::int64_t regularizer = 0;    ///< R1, a backward pass through a backward pass

    [[nodiscard]] std::int64_t peak() const;
};

/// The sum of what the layers of the model and of the loss report (LayerMemory). Of `phase` only
/// stage, resolution, batch, micro_batch and samples_per_ray are read. Within 25 % of the measured
/// peak for the model sizes of configs/ (`test_train "[memory]"`). Not counted: the decoded faces
/// that the data set keeps (data.cache_megabytes).
[[nodiscard]] StepMemory estimate_step_memory(const Model& model, const ReconstructionLoss& loss,
                                              const TrainConfig& config, const TrainingPhase& phase,
                                              const StepExecution& execution);

/// The first of these with which 1.25 times the estimate for this phase fits
/// memory.budget_gibibytes: micro-batches side by side, one after the other, so with the render
/// blocks computed twice, with the field too. Without a budget nothing is computed twice, and
/// micro-batches are side by side where half the machine's memory holds them. Only computing the
/// blocks twice changes results, by rounding. Throws ConfigError naming the key and the smallest
/// budget that would do.
[[nodiscard]] StepExecution choose_execution(const Model& model, const ReconstructionLoss& loss,
                                             const TrainConfig& config, const TrainingPhase& phase);

}  // namespace stymo
