#pragma once

#include <cstdint>

#include "nn/models/reconstruction.h"
#include "train/schedule.h"
#include "train/train_config.h"

namespace stymo {

/// Estimated peak of one training step, in bytes: the memory that lasts from step to step, and the
/// additional memory of each part of a step for the micro-batches that are computed at once. The
/// parts run one after the other.
struct StepMemory {
    std::int64_t persistent = 0;     ///< weights, their gradients, the optimisers' moments, EMA
    std::int64_t generator = 0;      ///< encoder, decoder and losses, forward and backward
    std::int64_t discriminator = 0;  ///< 0 in the first stage
    std::int64_t regularizer = 0;    ///< R1 (double backward)

    [[nodiscard]] std::int64_t peak() const;
};

/// Sums the LayerMemory of the model's layers and of the loss. Only stage, resolution, batch,
/// micro_batch and samples_per_ray of `phase` are read. `offset_numbers`: what the run learns for
/// its photos (PhotoOffsets). The estimate is within 25 % of the measured
/// peak for the model sizes of configs/ (`test_train "[memory]"`). It does not include the cache of
/// decoded faces (data.cache_megabytes).
[[nodiscard]] StepMemory estimate_step_memory(const Model& model, const ReconstructionLoss& loss,
                                              const TrainConfig& config, const TrainingPhase& phase,
                                              const StepExecution& execution,
                                              std::int64_t offset_numbers = 0);

/// The first of these choices for which 1.25 times the estimate for this phase fits into
/// memory.budget_gibibytes: micro-batches side by side; one after the other; also with recomputed
/// render blocks; also with a recomputed field. Without a budget nothing is recomputed, and
/// micro-batches are side by side if they fit into half the machine's memory. Only the
/// recomputation of render blocks changes results, by rounding. Throws ConfigError, which names the
/// key and the smallest sufficient budget.
[[nodiscard]] StepExecution choose_execution(const Model& model, const ReconstructionLoss& loss,
                                             const TrainConfig& config, const TrainingPhase& phase,
                                             std::int64_t offset_numbers = 0);

}  // namespace stymo
