#include "train/reconstruction_stage.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace stymo {

namespace {

constexpr const char* backbone_prefix = "encoder.backbone.";
constexpr const char* optimizer_prefix = "";

}  // namespace

ReconstructionStage::ReconstructionStage(const TrainingParts& parts)
    : parts_(parts),
      optimizer_({parts.config.optimizer.beta1, parts.config.optimizer.beta2,
                  parts.config.optimizer.epsilon},
                 parts.config.optimizer.matrices == "muon") {}

std::vector<Parameter> ReconstructionStage::unfreeze(const TrainingPosition& position) {
    const TrainConfig& config = parts_.config;
    const bool frozen = parts_.images.epochs(position.first_image) <
                            static_cast<double>(config.optimizer.backbone_frozen_epochs) &&
                        is_pretrained(config.model.encoder);
    std::vector<std::string> prefixes = trained_decoder_prefixes(parts_.model, position);
    prefixes.emplace_back("encoder.heads.");
    if (!frozen) prefixes.emplace_back(backbone_prefix);
    std::vector<Parameter> parameters = unfreeze_only(parts_.model.parameters(), prefixes);
    if (parts_.offsets != nullptr) {
        ParameterStore& offsets = parts_.offsets->parameters();
        offsets.set_trainable(PhotoOffsets::pose_prefix, learns_poses(config, position));
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

}  // namespace stymo
