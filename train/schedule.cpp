#include "train/schedule.h"

#include <algorithm>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {

std::int64_t StepExecution::at_once(const TrainingPhase& phase) const {
    return side_by_side ? std::clamp<std::int64_t>(phase.micro_batches(), 1, thread_count()) : 1;
}

bool learns_poses(const TrainConfig& config, const TrainingPosition& position) {
    const std::int64_t interval = config.stage1.pose_interval;
    return position.phase.stage == 1 && interval > 0 && position.step % interval == 0;
}

TrainingSchedule::TrainingSchedule(const TrainConfig& config) {
    const StageConfig& first = config.stage1;
    phases_.push_back({.resolution = stage1_resolution(config),
                       .steps = first.steps,
                       .batch = first.batch,
                       .micro_batch = first.micro_batch,
                       .samples_per_ray = first.samples_per_ray});
    const AdversarialStageConfig& second = config.stage2;
    for (std::size_t i = 0; i < second.resolutions.size(); ++i) {
        const TrainingPhase& last = phases_.back();
        phases_.push_back({.stage = 2,
                           .resolution = second.resolutions[i],
                           .first_step = last.first_step + last.steps,
                           .steps = (second.images[i] + second.batch[i] - 1) / second.batch[i],
                           .first_image = last.first_image + last.steps * last.batch,
                           .batch = second.batch[i],
                           .micro_batch = second.micro_batch[i],
                           .samples_per_ray = second.samples_per_ray,
                           .fade_images = second.fade_images[i],
                           .r1_gamma = second.r1_gamma[i]});
    }
    const TrainingPhase stage1 = phases_.front();
    std::erase_if(phases_, [](const TrainingPhase& phase) { return phase.steps == 0; });
    if (phases_.empty()) phases_.push_back(stage1);
}

void TrainingSchedule::choose_executions(
    const std::function<StepExecution(const TrainingPhase&)>& choose) {
    for (TrainingPhase& phase : phases_) phase.execution = choose(phase);
}

std::int64_t TrainingSchedule::steps() const {
    return phases_.back().first_step + phases_.back().steps;
}

TrainingPosition TrainingSchedule::position(std::int64_t step) const {
    if (step < 0) fail<ValueError>("no training run has a step ", step);
    const auto after = std::ranges::upper_bound(phases_, step, {}, &TrainingPhase::first_step);
    const TrainingPhase& phase = *std::prev(after);
    const std::int64_t within = step - phase.first_step;
    // The fade at the end of this step, so that a new block has a positive weight from its first
    // step on.
    const double faded = static_cast<double>((within + 1) * phase.batch) /
                         std::max(1.0, static_cast<double>(phase.fade_images));
    return {phase, within, std::min(1.0, faded), phase.first_image + within * phase.batch};
}

}  // namespace stymo
