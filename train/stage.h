#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/tensor_file.h"
#include "nn/optim/adam.h"
#include "train/data/training_images.h"
#include "train/generator_gradients.h"

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

/// Gradients of a batch as the mean of those of its micro-batches, equally large.
class GradientMean {
public:
    explicit GradientMean(std::size_t micro_batches)
        : part_(1.0 / static_cast<double>(micro_batches)),
          compensated_(micro_batches > most_plain_sums) {}

    /// Of each micro-batch in all.
    [[nodiscard]] double part() const { return part_; }
    void add(const std::vector<Variable>& gradients);
    [[nodiscard]] const std::vector<Variable>& gradients() const { return gradients_; }

private:
    /// With more, the rounding errors of float32 could exceed 4e-6.
    static constexpr std::size_t most_plain_sums = 64;

    double part_;
    bool compensated_;
    std::vector<Variable> gradients_;
    std::vector<Variable>
        excess_;  ///< by which each sum is too large (Kahan 1965); empty unless compensated
};

/// Means of `gradients_of(batch)` over the micro-batches of a step.
template <class GradientsOf>
[[nodiscard]] LossAndGradients mean_over_micro_batches(const TrainingParts& parts,
                                                       const TrainingPosition& position,
                                                       GradientsOf gradients_of) {
    const std::vector<std::int64_t> micro_batches = position.micro_batches();
    GradientMean mean(micro_batches.size());
    LossAndGradients result;
    for (const std::int64_t first_image : micro_batches) {
        const LossAndGradients one =
            gradients_of(parts.images.batch(first_image, position.phase.micro_batch));
        result.losses.accumulate(one.losses, mean.part());
        mean.add(one.gradients);
    }
    result.gradients = mean.gradients();
    return result;
}

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

/// The generator's learning rate; that of the parameters whose name begins with `prefix` is
/// `prefix_factor` times as large.
struct GeneratorRates {
    double learning_rate = 0.0;
    std::string_view prefix;
    double prefix_factor = 1.0;
};

/// One update of the unfrozen `parameters` of the generator, in either stage. Notes losses,
/// learning rate and what is not finite in the report; in that case nothing has changed.
void update_generator(const TrainingParts& parts, const TrainingPosition& position,
                      const Discriminator* discriminator, const std::vector<Parameter>& parameters,
                      Adam& adam, const GeneratorRates& rates, StepReport& report);

/// The random numbers of a step's samples, for one purpose.
[[nodiscard]] Rng step_jitter(const TrainingParts& parts, const TrainingPosition& position,
                              std::string_view purpose);

}  // namespace stymo
