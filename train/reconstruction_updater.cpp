#include "train/reconstruction_updater.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace stymo {

namespace {

constexpr const char* backbone_prefix = "encoder.backbone.";
constexpr const char* mask_prefix = "decoder.mask.";
constexpr const char* adam_prefix = "adam.";

}  // namespace

ReconstructionUpdater::ReconstructionUpdater(const TrainingParts& parts)
    : parts_(parts), adam_({parts.config.optimizer.beta1, parts.config.optimizer.beta2, parts.config.optimizer.epsilon}) {}

void ReconstructionUpdater::set_trainable_parts(const TrainingPlace& place, bool mask_loss) {
    const TrainConfig& config = parts_.config;
    const bool frozen = parts_.images.epochs(place.first_image) < static_cast<double>(config.optimizer.backbone_frozen_epochs) &&
                        !config.model.encoder.backbone_weights.empty();
    parts_.model.parameters().set_trainable("", true);
    parts_.model.parameters().set_trainable(backbone_prefix, !frozen);
    // What takes no part has no gradient, and the optimiser must not move it by what it remembers.
    for (std::int64_t side = 2 * place.phase.resolution; side <= config.model.decoder.resolution; side *= 2)
        parts_.model.parameters().set_trainable("decoder.block" + std::to_string(side) + ".", false);
    // Steps with a gradient of zero would use up the bias correction of its moments.
    parts_.model.parameters().set_trainable(mask_prefix, mask_loss);
}

double ReconstructionUpdater::learning_rate(const TrainingPlace& place) const {
    const OptimizerConfig& optimizer = parts_.config.optimizer;
    if (optimizer.schedule == "cosine") {
        const double steps = static_cast<double>(std::max<std::int64_t>(1, place.phase.steps));
        const double part = std::min(1.0, static_cast<double>(place.step) / steps);
        return optimizer.learning_rate * 0.5 * (1.0 + std::cos(std::numbers::pi * part));
    }
    return optimizer.learning_rate * std::pow(optimizer.decay, std::floor(parts_.images.epochs(place.first_image)));
}

StepReport ReconstructionUpdater::step(const TrainingPlace& place, bool mask_loss) {
    set_trainable_parts(place, mask_loss);
    std::vector<Parameter> parameters = parts_.model.parameters().trainable();
    if (parts_.offsets != nullptr) std::ranges::copy(parts_.offsets->parameters().trainable(), std::back_inserter(parameters));
    const std::vector<std::int64_t> micro_batches = place.micro_batches();
    StepReport report;
    GradientMean mean(micro_batches.size());
    Rng jitter = parts_.rng.split("jitter").split(static_cast<std::uint64_t>(place.phase.first_step + place.step));
    for (const std::int64_t first_image : micro_batches) {
        const TrainingBatch batch = parts_.images.batch(first_image, place.phase.micro_batch);
        const LossAndGradients result = reconstruction_gradients(parts_.model, parts_.reconstruction, batch, parts_.config,
                                                                 parameters, mask_loss, jitter, parts_.offsets);
        report.losses.accumulate(result.losses, mean.part());
        mean.add(result.gradients);
    }
    report.learning_rate = learning_rate(place);
    report.non_finite = non_finite(report.losses.total, parameters, mean.gradients());
    if (!report.non_finite) {
        step_in_two_groups(adam_, parameters, mean.gradients(), report.learning_rate, backbone_prefix,
                           report.learning_rate * parts_.config.optimizer.backbone_factor);
    }
    return report;
}

void ReconstructionUpdater::save(TensorFile& file) const {
    adam_.save(file, adam_prefix);
}

void ReconstructionUpdater::load(const TensorFile& file, const std::string& source) {
    adam_.load(file, source, adam_prefix);
}

}  // namespace stymo
