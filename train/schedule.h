#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "train/train_config.h"

namespace stymo {

struct TrainingPhase;

/// What the backward pass computes again instead of keeping it (see DecodeOptions).
struct Recomputation {
    bool blocks = false;  ///< the render blocks, image by image
    bool field = false;   ///< the field, tile by tile
};

/// How the micro-batches of a step are computed.
struct StepExecution {
    Recomputation recomputation;
    bool side_by_side = false;  ///< one micro-batch on each thread (for_each_micro_batch)

    /// Number of this phase's micro-batches that are computed at the same time.
    [[nodiscard]] std::int64_t at_once(const TrainingPhase& phase) const;
};

/// A part of a run with constant settings: the first stage, or the second stage at one resolution.
struct TrainingPhase {
    int stage = 1;
    std::int64_t resolution = 0;  ///< side of the largest image that is rendered and compared
    std::int64_t first_step = 0;  ///< counted over the whole run
    std::int64_t steps = 0;
    std::int64_t first_image = 0;  ///< number of images consumed by earlier phases
    std::int64_t batch = 0;
    std::int64_t micro_batch = 0;
    std::int64_t samples_per_ray = 0;
    std::int64_t fade_images = 0;  ///< images in which the discriminator's new block fades in
    double r1_gamma = 0.0;
    StepExecution execution{};  ///< chosen by the trainer (choose_execution)

    /// Micro-batches of each step.
    [[nodiscard]] std::int64_t micro_batches() const { return batch / micro_batch; }
};

/// The position of a step in its run.
struct TrainingPosition {
    TrainingPhase phase;
    std::int64_t step = 0;  ///< within the phase
    double fade = 1.0;      ///< weight of the discriminator's block for this resolution, in (0, 1]
    std::int64_t first_image = 0;
    bool mask_loss = false;  ///< whether the mask loss is on; set by the trainer
};

/// Whether a step learns the poses of its photos (StageConfig::pose_interval).
[[nodiscard]] bool learns_poses(const TrainConfig& config, const TrainingPosition& position);

/// The position of each step, a pure function of the configuration. To continue at the right images
/// and fade, a checkpoint therefore needs only the number of its step.
class TrainingSchedule {
public:
    explicit TrainingSchedule(const TrainConfig& config);

    /// The first stage, then one phase for each resolution of the second stage. Phases without
    /// steps are left out, but there is always at least one.
    [[nodiscard]] const std::vector<TrainingPhase>& phases() const { return phases_; }
    /// Sets how the steps of each phase are computed.
    void choose_executions(const std::function<StepExecution(const TrainingPhase&)>& choose);
    [[nodiscard]] std::int64_t steps() const;
    /// The position of a step. A step beyond the last one belongs to the last phase. Throws
    /// ValueError for a negative step.
    [[nodiscard]] TrainingPosition position(std::int64_t step) const;
    /// Images that the steps before this one consume.
    [[nodiscard]] std::int64_t images_before(std::int64_t step) const {
        return position(step).first_image;
    }

private:
    std::vector<TrainingPhase> phases_;
};

}  // namespace stymo
