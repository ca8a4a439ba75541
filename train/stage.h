#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/tensor_file.h"
#include "nn/optim/hybrid_optimizer.h"
#include "train/data/training_images.h"
#include "train/generator_gradients.h"
#include "train/ranks.h"

namespace stymo {

/// What one optimiser step found.
struct StepReport {
    LossValues losses;         ///< of the generator, with those of the discriminator by name
    bool regularized = false;  ///< the value "r1" was computed
    double learning_rate = 0.0;
    /// "the loss", or the first parameter whose gradient is infinite or not a number; nothing in a
    /// step that counts.
    std::optional<std::string> non_finite;
};

/// What both stages of a training train, and with what. All of it outlives the stages.
struct TrainingParts {
    const TrainConfig& config;
    const TrainingImages& images;
    const ReconstructionLoss& reconstruction;
    const Rng& rng;
    Model& model;
    CodeOffsets* offsets;  ///< null where no code learns any
    Ranks& ranks;
};

/// The optimiser steps of one stage, with all that they remember.
class TrainingStage {
public:
    virtual ~TrainingStage() = default;

    /// One optimiser step; a pure function of the position, the weights and what the stage
    /// remembers. With a loss or gradient that is not finite nothing changes at all.
    [[nodiscard]] virtual StepReport step(const TrainingPosition& position) = 0;
    /// The configuration's key of its learning rate.
    [[nodiscard]] virtual std::string learning_rate_key() const = 0;

    /// Adds what the next step depends on, the model's weights aside.
    virtual void save(TensorFile& file) const = 0;
    /// Goes on from what `save` wrote; what the file does not have begins anew. Throws FileError
    /// naming `source` and what does not fit.
    virtual void load(const TensorFile& file, const std::string& source) = 0;
};

/// Calls body(i) for each i below `count`. Side by side, as many calls as there are threads run at
/// a time, each on one thread; what is left over, or everything else, runs one after the other,
/// each call on all threads.
void for_each_micro_batch(std::int64_t count, bool side_by_side,
                          const std::function<void(std::int64_t)>& body);
/// Whether a step of this phase computes its micro-batches side by side.
[[nodiscard]] bool side_by_side(const TrainingParts& parts, const TrainingPhase& phase);

/// Losses of a micro-batch, whose first image has this number within the step. The gradients of the
/// parameters go to the sink.
using MicroBatchGradients = std::function<LossValues(
    const FaceBatch& batch, std::int64_t first_image, const GradientSink& sink)>;

/// Means over the micro-batches of a step, of which each rank computes its share. `gradients_of` is
/// called on several threads. Gradients travel to the other ranks while it still runs.
[[nodiscard]] LossAndGradients mean_over_micro_batches(const TrainingParts& parts,
                                                       const TrainingPosition& position,
                                                       const std::vector<Parameter>& parameters,
                                                       const MicroBatchGradients& gradients_of);

/// What is not finite in an update, if anything is.
[[nodiscard]] std::optional<std::string> non_finite(const LossAndGradients& update,
                                                    const std::vector<Parameter>& parameters);

/// Unfreezes the parameters whose names begin with one of the prefixes, and freezes all others:
/// what takes no part in a step has no gradient, and the optimiser must not move it by what it
/// remembers. Returns the unfrozen ones.
std::vector<Parameter> unfreeze_only(ParameterStore& parameters,
                                     const std::vector<std::string>& prefixes);
/// Prefixes of the decoder's layers that a step trains: those up to the phase's resolution, and the
/// mask branch once its loss is on. Steps with a gradient of zero would use up the bias correction
/// of the mask branch's moments.
[[nodiscard]] std::vector<std::string> trained_decoder_prefixes(const Model& model,
                                                                const TrainingPosition& position);

/// What the generator's update learns from beside the photos.
struct Adversary {
    const Discriminator* discriminator = nullptr;
    double augmentation = 0.0;  ///< the probability with which what it sees is changed
};

/// One update of the unfrozen `parameters` of the generator, in either stage. Notes losses,
/// learning rate and what is not finite in the report; in that case nothing has changed.
void update_generator(const TrainingParts& parts, const TrainingPosition& position,
                      const Adversary& adversary, const std::vector<Parameter>& parameters,
                      HybridOptimizer& optimizer, const OptimizerRates& rates, StepReport& report);

/// The random numbers of a step's samples, for one purpose, from the samples of this image of the
/// step on.
[[nodiscard]] Rng step_jitter(const TrainingParts& parts, const TrainingPosition& position,
                              std::string_view purpose, std::int64_t image);
/// Augmentations of so many images of a step, from this one on, for one purpose; none at all if
/// they have no probability.
[[nodiscard]] std::vector<ImageAugmentation> step_augmentations(
    const TrainingParts& parts, const TrainingPosition& position, std::string_view purpose,
    std::int64_t image, std::int64_t count, double probability);

}  // namespace stymo
