#pragma once

#include <cstdint>
#include <vector>

#include "train/train_config.h"

namespace stymo {

/// A part of a run in which nothing but weights and fade changes from step to step: the first
/// stage, or the second stage at one resolution.
struct TrainingPhase {
    int stage = 1;
    std::int64_t resolution = 0;  ///< of the largest image that is rendered and compared
    std::int64_t first_step = 0;  ///< counted over the whole run, as all steps
    std::int64_t steps = 0;
    std::int64_t first_image = 0;  ///< images consumed by the phases before
    std::int64_t batch = 0;
    std::int64_t micro_batch = 0;
    std::int64_t samples_per_ray = 0;
    std::int64_t fade_images = 0;  ///< while the discriminator's new block fades in
    double r1_gamma = 0.0;

    /// Of each step.
    [[nodiscard]] std::int64_t micro_batches() const { return batch / micro_batch; }
};

/// Where a step stands in its run.
struct TrainingPosition {
    TrainingPhase phase;
    std::int64_t step = 0;  ///< within the phase
    double fade = 1.0;      ///< of the resolution's block in the discriminator, in (0, 1]
    std::int64_t first_image = 0;
    bool mask_loss = false;  ///< whether the mask loss is on by now, as the trainer decides
};

/// The position of each step, a pure function of the configuration. So a checkpoint continues at
/// the right images and fade with nothing but the number of its step.
class TrainingSchedule {
public:
    explicit TrainingSchedule(const TrainConfig& config);

    /// The first stage, then one phase for each resolution of the second; those without steps are
    /// left out, but one always stays.
    [[nodiscard]] const std::vector<TrainingPhase>& phases() const { return phases_; }
    [[nodiscard]] std::int64_t steps() const;
    /// A step beyond the last one belongs to the last phase. Throws ValueError for a
    /// negative one.
    [[nodiscard]] TrainingPosition position(std::int64_t step) const;
    /// Images that the steps before this one consume.
    [[nodiscard]] std::int64_t images_before(std::int64_t step) const {
        return position(step).first_image;
    }

private:
    std::vector<TrainingPhase> phases_;
};

}  // namespace stymo
