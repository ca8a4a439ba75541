#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "nn/image_augmentation.h"
#include "nn/models/discriminator.h"
#include "nn/models/face_batch.h"
#include "nn/models/identity_network.h"
#include "nn/models/model.h"
#include "nn/models/reconstruction.h"
#include "train/schedule.h"

namespace stymo {

/// Named values of a loss, in the order in which they were first set.
class LossValues {
public:
    double total = 0.0;  ///< the weighted sum of the terms

    /// 0 for a name that was never set.
    [[nodiscard]] double operator[](std::string_view name) const;
    /// The value of this name, which is first set to 0 if it is new.
    double& operator[](std::string_view name);
    /// Adds `part` times the total and each value of `other`.
    void accumulate(const LossValues& other, double part);

    /// One line of names and values, from which `parse` restores the same bits.
    [[nodiscard]] std::string text() const;
    [[nodiscard]] static LossValues parse(const std::string& text);

private:
    std::vector<std::pair<std::string, double>> values_;
};

/// Inputs of the terms of the generator's loss: one micro-batch and the model's outputs for it.
struct LossInputs {
    const Model& model;
    const TrainConfig& config;
    const TrainingPosition& position;
    const FaceBatch& batch;
    const ReconstructionLoss& reconstruction;
    const Codes& codes;
    const Decoded& decoded;
    const Discriminator* discriminator;  ///< null without an adversarial term
    /// Augmentations of the images that the discriminator sees.
    std::span<const ImageAugmentation> augmentations;
    const IdentityNetwork* identity = nullptr;  ///< null without an identity term
};

/// A term of the generator's loss. To add one: write its function in nn/losses.h, add it to the
/// list in loss_terms.cpp, and its weight to LossConfig (train_config.h).
struct LossTerm {
    std::string_view name;  ///< in stats.jsonl and TensorBoard
    /// 0: the term is not computed.
    double (*weight)(const LossInputs& inputs);
    /// The term without its weight, a mean over the micro-batch. Sets the values of its `parts`.
    Variable (*value)(const LossInputs& inputs, LossValues& values);
    std::vector<std::string_view> parts{};  ///< names of further values that it sets
    bool second_stage_alone = false;
};

/// Rendered images of the batch's faces without what is unknown in the photos, as in its targets.
[[nodiscard]] Variable seen_by_discriminator(const Variable& images, const FaceBatch& batch);

/// Side of the images that are rendered beside those of the batch, for the terms "side_identity"
/// and "expression": the largest of the ladder that the phase renders and that has at most 128
/// pixels, or the smallest.
[[nodiscard]] std::int64_t aside_side(const ResolutionLadder& ladder, const TrainingPhase& phase);

/// Name, among the losses, of the share of samples that take part in the backward pass.
inline constexpr std::string_view significant_share = "significant_samples";

/// All terms, in the order in which they are summed.
[[nodiscard]] std::span<const LossTerm> loss_terms();
/// The names of the terms of this stage and of their parts, and `significant_share`.
[[nodiscard]] std::vector<std::string_view> loss_names(int stage);

}  // namespace stymo
