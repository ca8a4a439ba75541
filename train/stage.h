#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/tensor_file.h"
#include "nn/optim/muon.h"
#include "train/data/training_images.h"
#include "train/step_gradients.h"
#include "train/gradient_sums.h"

namespace stymo {

/// Result of one optimiser step.
struct StepReport {
    LossValues losses;         ///< of the generator; also named values of the discriminator
    bool regularized = false;  ///< whether "r1" was computed
    double learning_rate = 0.0;
    /// "the loss" or the name of the first parameter whose gradient is not finite; nothing after a
    /// successful step.
    std::optional<std::string> non_finite;
};

/// The objects that both stages of a training use. They must outlive the stages.
struct TrainingParts {
    const TrainConfig& config;
    const TrainingImages& images;
    const ReconstructionLoss& reconstruction;
    const Rng& rng;
    Model& model;
    PhotoOffsets* offsets;  ///< null if none are learnt
    Ranks& ranks;
    const IdentityNetwork* identity = nullptr;  ///< null without an identity term
};

/// The optimiser steps of one stage, with their state.
class TrainingStage {
public:
    virtual ~TrainingStage() = default;

    /// One optimiser step: a pure function of the position, the weights and the state of the stage.
    /// If the loss or a gradient is not finite, nothing changes.
    [[nodiscard]] virtual StepReport step(const TrainingPosition& position) = 0;
    /// The configuration's key of its learning rate.
    [[nodiscard]] virtual std::string learning_rate_key() const = 0;

    /// Adds the state on which the next step depends, without the model's weights.
    virtual void save(TensorFile& file) const = 0;
    /// Restores the state that `save` wrote. State that the file does not have is reset. Throws
    /// FileError, which names `source` and what does not match.
    virtual void load(const TensorFile& file, const std::string& source) = 0;
};

/// Calls body(i) for each i below `count`: with `side_by_side` as `parallel_tasks` does, otherwise
/// one after the other.
void for_each_micro_batch(std::int64_t count, bool side_by_side,
                          const std::function<void(std::int64_t)>& body);

/// Some faces of a step that are computed at once.
struct MicroBatch {
    FaceBatch faces;               ///< with the targets of the phase
    std::int64_t first_image = 0;  ///< number of its first image within the step
    std::optional<Codes> codes{};  ///< of the faces, where they are constants
};
/// Loads micro-batch `index` of this rank, without codes.
[[nodiscard]] MicroBatch load_micro_batch(const TrainingParts& parts,
                                          const TrainingPosition& position, std::int64_t index);

/// Computes the losses of a micro-batch, and passes the gradients of the parameters to `sink`.
using MicroBatchGradients =
    std::function<LossValues(const MicroBatch& batch, const GradientSink& sink)>;

/// Means of losses and gradients over the micro-batches of a step. Each rank computes its share of
/// them: those that are `loaded`, or, if there are none, each is loaded when it is computed.
/// `gradients_of` may be called on several threads. Gradients are sent to other ranks while others
/// are still being computed.
[[nodiscard]] LossAndGradients mean_over_micro_batches(const TrainingParts& parts,
                                                       const TrainingPosition& position,
                                                       const std::vector<Parameter>& parameters,
                                                       std::span<const MicroBatch> loaded,
                                                       const MicroBatchGradients& gradients_of);

/// Names what is not finite in an update ("the loss" or a parameter); nothing if all is finite.
[[nodiscard]] std::optional<std::string> non_finite(const LossAndGradients& update,
                                                    const std::vector<Parameter>& parameters);

/// Unfreezes the parameters whose names begin with one of the prefixes, and freezes all others.
/// Parameters that take no part in a step have no gradient, and the optimiser must not move them by
/// their momentum. Returns the unfrozen parameters.
std::vector<Parameter> unfreeze_only(ParameterStore& parameters,
                                     const std::vector<std::string>& prefixes);
/// Prefixes of the decoder's layers that a step trains: those up to the phase's resolution, and the
/// mask branch if its loss is on. (Before that its gradients would be zero, and Adam's bias
/// correction would end before the first real gradient.)
[[nodiscard]] std::vector<std::string> trained_decoder_prefixes(const Model& model,
                                                                const TrainingPosition& position);

/// The discriminator for the generator's update.
struct Adversary {
    const Discriminator* discriminator = nullptr;
    double augmentation = 0.0;  ///< augmentation probability of the images that it sees
};

/// One update of the unfrozen `parameters` of the generator, in either stage. Records losses and
/// learning rate in the report. If the loss or a gradient is not finite, it records that and
/// changes nothing. `loaded` as in mean_over_micro_batches.
void update_generator(const TrainingParts& parts, const TrainingPosition& position,
                      const Adversary& adversary, const std::vector<Parameter>& parameters,
                      std::span<const MicroBatch> loaded, HybridOptimizer& optimizer,
                      const OptimizerRates& rates, StepReport& report);

/// The generator of the random samples of a step for one purpose, advanced to the samples of image
/// `image` of the step.
[[nodiscard]] Rng step_jitter(const TrainingParts& parts, const TrainingPosition& position,
                              std::string_view purpose, std::int64_t image);
/// Augmentations of `count` images of a step from image `image` on, for one purpose; empty if the
/// probability is 0.
[[nodiscard]] std::vector<ImageAugmentation> step_augmentations(
    const TrainingParts& parts, const TrainingPosition& position, std::string_view purpose,
    std::int64_t image, std::int64_t count, double probability);

}  // namespace stymo
