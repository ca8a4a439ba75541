#include "train/stages.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "train/step_gradients.h"

namespace stymo {

namespace {

constexpr const char* backbone_prefix = "encoder.backbone.";
constexpr const char* optimizer_prefix = "";

MuonScope muon_scope(const OptimizerConfig& config) {
    if (config.matrices == "muon") return MuonScope::decoder;
    return config.matrices == "muon_encoder" ? MuonScope::encoder_and_decoder : MuonScope::none;
}

}  // namespace

ReconstructionStage::ReconstructionStage(const TrainingParts& parts)
    : parts_(parts),
      optimizer_({parts.config.optimizer.beta1, parts.config.optimizer.beta2,
                  parts.config.optimizer.epsilon},
                 muon_scope(parts.config.optimizer)) {}

std::vector<Parameter> ReconstructionStage::unfreeze(const TrainingPosition& position) {
    const TrainConfig& config = parts_.config;
    const bool backbone_waits = parts_.images.epochs(position.first_image) <
                                    static_cast<double>(config.optimizer.backbone_frozen_epochs) &&
                                is_pretrained(config.model.encoder);
    std::vector<std::string> prefixes{"encoder.corrector."};
    if (!config.stage1.encoder_frozen) prefixes.emplace_back("encoder.heads.");
    if (!config.stage1.encoder_frozen && !backbone_waits) prefixes.emplace_back(backbone_prefix);
    if (!config.stage1.decoder_frozen)
        std::ranges::copy(trained_decoder_prefixes(parts_.model, position),
                          std::back_inserter(prefixes));
    std::vector<Parameter> parameters = unfreeze_only(parts_.model.parameters(), prefixes);
    if (parts_.offsets != nullptr) {
        ParameterStore& offsets = parts_.offsets->parameters();
        offsets.set_trainable(PhotoOffsets::pose_prefix, learns_poses(config, position));
        // The saved model lacks them, and only this encoder can make up for that.
        offsets.set_trainable(PhotoOffsets::source_prefix, !config.stage1.decoder_frozen);
        std::ranges::copy(offsets.trainable(), std::back_inserter(parameters));
    }
    return parameters;
}

double ReconstructionStage::learning_rate(const TrainingPosition& position) const {
    const OptimizerConfig& optimizer = parts_.config.optimizer;
    if (optimizer.schedule == "cosine") {
        const double steps = static_cast<double>(std::max<std::int64_t>(1, position.phase.steps));
        const double part = std::min(1.0, static_cast<double>(position.step) / steps);
        return optimizer.learning_rate * 0.5 * (1.0 + std::cos(std::numbers::pi * part));
    }
    return optimizer.learning_rate *
           std::pow(optimizer.decay, std::floor(parts_.images.epochs(position.first_image)));
}

StepReport ReconstructionStage::step(const TrainingPosition& position) {
    StepReport report;
    update_generator(
        parts_, position, {}, unfreeze(position), {}, optimizer_,
        {learning_rate(position), backbone_prefix, parts_.config.optimizer.backbone_factor},
        report);
    return report;
}

void ReconstructionStage::save(TensorFile& file) const {
    optimizer_.save(file, optimizer_prefix);
}

void ReconstructionStage::load(const TensorFile& file, const std::string& source) {
    optimizer_.load(file, source, optimizer_prefix);
}

namespace {

constexpr const char* mapping_prefix = "decoder.mapping.";
constexpr const char* discriminator_name = "discriminator";
constexpr const char* discriminator_prefix = "discriminator.";
constexpr const char* generator_prefix = "generator_";
constexpr const char* discriminator_adam_prefix = "discriminator_adam.";
constexpr const char* augmentation_name = "discriminator_augmentation";

/// StyleGAN2's correction of Adam's rates for lazy regularization: r steps take r + 1 updates.
double lazy_part(const AdversarialStageConfig& config) {
    const auto interval = static_cast<double>(config.r1_interval);
    return interval / (interval + 1.0);
}

AdamOptions discriminator_adam(const AdversarialStageConfig& config) {
    const double part = lazy_part(config);
    return {std::pow(config.beta1, part), std::pow(config.beta2, part), config.epsilon};
}

}  // namespace

AdversarialStage::TrainedDiscriminator::TrainedDiscriminator(const TrainConfig& config, Rng rng)
    : network(config.discriminator, config.model.decoder.resolution, parameters, discriminator_name,
              rng),
      adam(discriminator_adam(config.stage2)),
      augmentation(config.stage2.augmentation_target, config.stage2.augmentation_images) {}

AdversarialStage::AdversarialStage(const TrainingParts& parts)
    : parts_(parts),
      optimizer_(
          {parts.config.stage2.beta1, parts.config.stage2.beta2, parts.config.stage2.epsilon},
          MuonScope::none) {
    if (parts.config.loss.adversarial_weight > 0.0)
        discriminator_.emplace(parts.config, parts.rng.split(discriminator_name));
}

std::vector<Parameter> AdversarialStage::unfreeze_discriminator(const TrainingPosition& position) {
    const std::int64_t resolution = position.phase.resolution;
    const ResolutionLadder ladder = parts_.model.decoder().ladder().up_to(resolution);
    std::vector<std::string> prefixes;
    for (const std::int64_t side : ladder.sides()) {
        for (std::string& prefix : Discriminator::prefixes_of(discriminator_name, side))
            prefixes.push_back(std::move(prefix));
        // The discriminator reads the images through one fromRGB layer, and while the block fades
        // in also through that of the resolution below.
        const bool entered = side == resolution || (2 * side == resolution && position.fade < 1.0);
        if (!entered)
            std::erase(prefixes, discriminator_prefix + ("from_rgb" + std::to_string(side)) + ".");
    }
    return unfreeze_only(discriminator_->parameters, prefixes);
}

void AdversarialStage::apply(const LossAndGradients& update,
                             const std::vector<Parameter>& parameters, StepReport& report) {
    for (const std::string_view name : discriminator_loss_names)
        report.losses[name] += update.losses[name];
    report.non_finite = non_finite(update, parameters);
    const AdversarialStageConfig& config = parts_.config.stage2;
    if (!report.non_finite)
        discriminator_->adam.step(parameters, update.gradients,
                                  config.discriminator_learning_rate * lazy_part(config));
}

void AdversarialStage::load_faces(const TrainingPosition& position) {
    // Frozen, so that no graph is recorded while photos are encoded and images are rendered.
    parts_.model.parameters().set_trainable("", false);
    const TrainingPhase& phase = position.phase;
    batches_.resize(static_cast<std::size_t>(phase.micro_batches() / parts_.ranks.size()));
    for_each_micro_batch(std::ssize(batches_), phase.execution.side_by_side, [&](std::int64_t k) {
        MicroBatch batch = load_micro_batch(parts_, position, k);
        batch.codes = detached(face_codes(parts_.model, batch.faces, parts_.offsets));
        // Of what follows the identity term alone reads the photos.
        if (parts_.config.loss.identity_weight == 0.0)
            batch.faces.input = batch.faces.other_input = {};
        batches_[static_cast<std::size_t>(k)] = std::move(batch);
    });
}

void AdversarialStage::update_discriminator(const TrainingPosition& position, StepReport& report) {
    const std::vector<Parameter> parameters = unfreeze_discriminator(position);
    const double probability = discriminator_->augmentation.value();
    const auto gradients = [&](const MicroBatch& batch, const GradientSink& sink) {
        Rng jitter = step_jitter(parts_, position, "discriminator jitter", batch.first_image);
        std::vector<ImageAugmentation> augmentations;
        for (const std::string_view purpose : {"photo augmentation", "rendering augmentation"})
            std::ranges::copy(step_augmentations(parts_, position, purpose, batch.first_image,
                                                 std::ssize(batch.faces.cameras), probability),
                              std::back_inserter(augmentations));
        const GeneratorInputs inputs{parts_.model,   parts_.reconstruction,    parts_.config,
                                     parts_.offsets, &discriminator_->network, augmentations,
                                     &*batch.codes};
        return discriminator_gradients(inputs, position, batch.faces, parameters, jitter, sink)
            .losses;
    };
    apply(mean_over_micro_batches(parts_, position, parameters, batches_, gradients), parameters,
          report);
    report.losses["augmentation"] = probability;
    if (!report.non_finite)
        discriminator_->augmentation.update(report.losses["real_sign"],
                                            static_cast<double>(position.phase.batch));
}

void AdversarialStage::regularize_discriminator(const TrainingPosition& position,
                                                StepReport& report) {
    const std::int64_t interval = parts_.config.stage2.r1_interval;
    const double gamma = position.phase.r1_gamma;
    if (report.non_finite || position.step % interval != 0 || gamma == 0.0) return;
    const std::vector<Parameter> parameters = unfreeze_discriminator(position);
    const double weight = gamma * static_cast<double>(interval);
    apply(mean_over_micro_batches(
              parts_, position, parameters, batches_,
              [&](const MicroBatch& batch, const GradientSink& sink) {
                  return r1_gradients(
                             discriminator_->network, position, batch.faces, weight, parameters,
                             step_augmentations(parts_, position, "R1 augmentation",
                                                batch.first_image, std::ssize(batch.faces.cameras),
                                                discriminator_->augmentation.value()),
                             sink)
                      .losses;
              }),
          parameters, report);
    report.regularized = true;
}

void AdversarialStage::update_decoder(const TrainingPosition& position, StepReport& report) {
    if (report.non_finite) return;
    if (discriminator_) discriminator_->parameters.set_trainable("", false);
    const AdversarialStageConfig& config = parts_.config.stage2;
    const std::vector<Parameter> parameters =
        unfreeze_only(parts_.model.parameters(), trained_decoder_prefixes(parts_.model, position));
    const Adversary adversary =
        discriminator_ ? Adversary{&discriminator_->network, discriminator_->augmentation.value()}
                       : Adversary{};
    update_generator(parts_, position, adversary, parameters, batches_, optimizer_,
                     {config.learning_rate, mapping_prefix, config.mapping_factor}, report);
}

StepReport AdversarialStage::step(const TrainingPosition& position) {
    StepReport report;
    if (!discriminator_) {
        update_decoder(position, report);
        return report;
    }
    // If any update of the step is not finite, all are undone.
    const std::vector<Variable> values = variables_of(discriminator_->parameters.all());
    const Adam adam = discriminator_->adam;
    const AdaptiveProbability augmentation = discriminator_->augmentation;
    load_faces(position);
    update_discriminator(position, report);
    regularize_discriminator(position, report);
    update_decoder(position, report);
    batches_.clear();
    if (report.non_finite) {
        for (std::size_t i = 0; i < values.size(); ++i)
            discriminator_->parameters.all()[i].set_value(values[i].value());
        discriminator_->adam = adam;
        discriminator_->augmentation = augmentation;
    }
    return report;
}

void AdversarialStage::save(TensorFile& file) const {
    optimizer_.save(file, generator_prefix);
    if (!discriminator_) return;
    discriminator_->parameters.save(file);
    discriminator_->adam.save(file, discriminator_adam_prefix);
    if (discriminator_->augmentation.adapts())
        file.tensors[augmentation_name] =
            Tensor::full({1}, discriminator_->augmentation.value(), DType::float64);
}

void AdversarialStage::load(const TensorFile& file, const std::string& source) {
    optimizer_.load(file, source, generator_prefix);
    if (!discriminator_ || !has_prefix(file, discriminator_prefix)) return;
    discriminator_->parameters.load(file, source);
    discriminator_->adam.load(file, source, discriminator_adam_prefix);
    if (const auto found = file.tensors.find(augmentation_name); found != file.tensors.end())
        discriminator_->augmentation.set(found->second.to_vector().at(0));
}

}  // namespace stymo
