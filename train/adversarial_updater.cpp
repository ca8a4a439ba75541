#include "train/adversarial_updater.h"

#include <cmath>

namespace stymo {

namespace {

constexpr const char* mapping_prefix = "decoder.mapping.";
constexpr const char* discriminator_name = "discriminator";
constexpr const char* discriminator_prefix = "discriminator.";
constexpr const char* adam_prefix = "generator_adam.";
constexpr const char* discriminator_adam_prefix = "discriminator_adam.";

/// StyleGAN2's correction for updates that come every so many steps and count as much: r steps take r + 1 of them.
double lazy_part(const AdversarialStageConfig& config) {
    const auto interval = static_cast<double>(config.r1_interval);
    return interval / (interval + 1.0);
}

AdamOptions discriminator_adam(const AdversarialStageConfig& config) {
    const double part = lazy_part(config);
    return {std::pow(config.beta1, part), std::pow(config.beta2, part), config.epsilon};
}

AdversarialPhase adversarial_phase(const TrainingPlace& place) {
    return {place.phase.resolution, place.fade, place.phase.samples_per_ray};
}

/// Thaws the decoder up to the phase's resolution, and nothing else: what takes no part has no gradient, and the optimiser must
/// not move it by what it remembers.
std::vector<Parameter> thaw_decoder(ParameterStore& parameters, std::int64_t resolution, bool mask_loss) {
    parameters.set_trainable("", false);
    parameters.set_trainable(mapping_prefix, true);
    parameters.set_trainable("decoder.field.", true);
    for (std::int64_t side = 64; side <= resolution; side *= 2)
        parameters.set_trainable("decoder.block" + std::to_string(side) + ".", true);
    parameters.set_trainable("decoder.mask.", mask_loss);
    return parameters.trainable();
}

std::vector<Tensor> values_of(const ParameterStore& parameters) {
    std::vector<Tensor> values;
    for (const Parameter& parameter : parameters.all()) values.push_back(parameter.variable().value());
    return values;
}

}  // namespace

AdversarialUpdater::Judge::Judge(const TrainConfig& config, Rng rng)
    : discriminator(config.discriminator, config.model.decoder.resolution, parameters, discriminator_name, rng),
      adam(discriminator_adam(config.stage2)) {}

AdversarialUpdater::AdversarialUpdater(const TrainingParts& parts)
    : parts_(parts), adam_({parts.config.stage2.beta1, parts.config.stage2.beta2, parts.config.stage2.epsilon}) {
    if (parts.config.loss.adversarial_weight > 0.0) judge_.emplace(parts.config, parts.rng.split(discriminator_name));
}

double AdversarialUpdater::discriminator_learning_rate() const {
    return parts_.config.stage2.discriminator_learning_rate * lazy_part(parts_.config.stage2);
}

std::vector<Parameter> AdversarialUpdater::thaw_discriminator(const TrainingPlace& place) {
    const std::int64_t resolution = place.phase.resolution;
    ParameterStore& parameters = judge_->parameters;
    parameters.set_trainable("", false);
    for (std::int64_t side = 64; side <= resolution; side *= 2) {
        for (const std::string& prefix : Discriminator::prefixes_of(discriminator_name, side))
            parameters.set_trainable(prefix, true);
        // Of the entrances only that of the images themselves is in use, and that of the resolution before while it fades out.
        const bool entered = side == resolution || (2 * side == resolution && place.fade < 1.0);
        if (!entered) parameters.set_trainable(discriminator_prefix + ("from_rgb" + std::to_string(side)), false);
    }
    return parameters.trainable();
}

std::optional<std::string> AdversarialUpdater::update_discriminator(const TrainingPlace& place, StepReport& report) {
    const std::vector<std::int64_t> micro_batches = place.micro_batches();
    // So that the pictures it judges are made without a graph.
    parts_.model.parameters().set_trainable("", false);
    const std::vector<Parameter> parameters = thaw_discriminator(place);
    GradientMean mean(micro_batches.size());
    Rng jitter = parts_.rng.split("discriminator jitter").split(static_cast<std::uint64_t>(place.phase.first_step + place.step));
    for (const std::int64_t first_image : micro_batches) {
        const TrainingBatch batch = parts_.images.batch(first_image, place.phase.micro_batch);
        const DiscriminatorGradients result = discriminator_gradients(
            parts_.model, judge_->discriminator, batch, adversarial_phase(place), parameters, jitter, parts_.offsets);
        report.discriminator.accumulate(result.losses, mean.part());
        mean.add(result.gradients);
    }
    std::optional<std::string> broken = non_finite(report.discriminator.loss, parameters, mean.gradients());
    if (!broken) judge_->adam.step(parameters, mean.gradients(), discriminator_learning_rate());
    return broken;
}

std::optional<std::string> AdversarialUpdater::regularize_discriminator(const TrainingPlace& place, StepReport& report) {
    const AdversarialStageConfig& config = parts_.config.stage2;
    if (place.step % config.r1_interval != 0 || place.phase.r1_gamma == 0.0) return std::nullopt;
    const std::vector<std::int64_t> micro_batches = place.micro_batches();
    const std::vector<Parameter> parameters = thaw_discriminator(place);
    const double weight = place.phase.r1_gamma * static_cast<double>(config.r1_interval);
    GradientMean mean(micro_batches.size());
    for (const std::int64_t first_image : micro_batches) {
        const TrainingBatch batch = parts_.images.batch(first_image, place.phase.micro_batch);
        const DiscriminatorGradients result =
            r1_gradients(judge_->discriminator, batch, adversarial_phase(place), weight, parameters);
        report.discriminator.r1 += mean.part() * result.losses.r1;
        mean.add(result.gradients);
    }
    report.regularized = true;
    std::optional<std::string> broken = non_finite(report.discriminator.r1, parameters, mean.gradients());
    if (!broken) judge_->adam.step(parameters, mean.gradients(), discriminator_learning_rate());
    return broken;
}

std::optional<std::string> AdversarialUpdater::update_generator(const TrainingPlace& place, bool mask_loss, StepReport& report) {
    const std::vector<std::int64_t> micro_batches = place.micro_batches();
    if (judge_) judge_->parameters.set_trainable("", false);
    const std::vector<Parameter> parameters = thaw_decoder(parts_.model.parameters(), place.phase.resolution, mask_loss);
    GradientMean mean(micro_batches.size());
    Rng jitter = parts_.rng.split("jitter").split(static_cast<std::uint64_t>(place.phase.first_step + place.step));
    for (const std::int64_t first_image : micro_batches) {
        const TrainingBatch batch = parts_.images.batch(first_image, place.phase.micro_batch);
        const LossAndGradients result =
            generator_gradients(parts_.model, judge_ ? &judge_->discriminator : nullptr, parts_.reconstruction, batch,
                                adversarial_phase(place), parts_.config, parameters, mask_loss, jitter, parts_.offsets);
        report.losses.accumulate(result.losses, mean.part());
        mean.add(result.gradients);
    }
    report.learning_rate = parts_.config.stage2.learning_rate;
    std::optional<std::string> broken = non_finite(report.losses.total, parameters, mean.gradients());
    if (!broken) {
        step_in_two_groups(adam_, parameters, mean.gradients(), report.learning_rate, mapping_prefix,
                           report.learning_rate * parts_.config.stage2.mapping_factor);
    }
    return broken;
}

StepReport AdversarialUpdater::step(const TrainingPlace& place, bool mask_loss) {
    StepReport report;
    if (!judge_) {
        report.non_finite = update_generator(place, mask_loss, report);
        return report;
    }
    // A step counts as a whole or not at all.
    const std::vector<Tensor> values = values_of(judge_->parameters);
    const Adam adam = judge_->adam;
    report.non_finite = update_discriminator(place, report);
    if (!report.non_finite) report.non_finite = regularize_discriminator(place, report);
    if (!report.non_finite) report.non_finite = update_generator(place, mask_loss, report);
    if (report.non_finite) {
        for (std::size_t i = 0; i < values.size(); ++i) judge_->parameters.all()[i].set_value(values[i]);
        judge_->adam = adam;
    }
    return report;
}

void AdversarialUpdater::save(TensorFile& file) const {
    adam_.save(file, adam_prefix);
    if (!judge_) return;
    judge_->parameters.save(file);
    judge_->adam.save(file, discriminator_adam_prefix);
}

void AdversarialUpdater::load(const TensorFile& file, const std::string& source) {
    adam_.load(file, source, adam_prefix);
    if (!judge_ || !has_prefix(file, discriminator_prefix)) return;
    judge_->parameters.load(file, source);
    judge_->adam.load(file, source, discriminator_adam_prefix);
}

}  // namespace stymo
