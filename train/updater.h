#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/tensor_file.h"
#include "nn/optim/adam.h"
#include "train/adversarial_stage.h"
#include "train/reconstruction_stage.h"
#include "train/schedule.h"
#include "train/training_images.h"

namespace stymo {

/// What one optimiser step found.
struct StepReport {
    LossTerms losses;
    DiscriminatorTerms discriminator;
    bool regularized = false;  ///< `discriminator.r1` was computed
    double learning_rate = 0.0;
    /// "the loss", or the first parameter whose gradient is infinite or not a number; nothing in a step that counts.
    std::optional<std::string> non_finite;
};

/// What both stages of a training train, and with what. All of it outlives the updaters.
struct TrainingParts {
    const TrainConfig& config;
    const TrainingImages& images;
    const ReconstructionLoss& reconstruction;
    const Rng& rng;
    Model& model;
    CodeOffsets* offsets;  ///< null where no code learns any
};

/// The optimiser steps of one stage, with all that they remember.
class Updater {
public:
    virtual ~Updater() = default;

    /// One optimiser step; a pure function of the place, the weights and what the updater remembers. With a loss or gradient that
    /// is not finite nothing changes at all.
    [[nodiscard]] virtual StepReport step(const TrainingPlace& place, bool mask_loss) = 0;
    /// The configuration's key of its learning rate.
    [[nodiscard]] virtual std::string learning_rate_key() const = 0;

    /// Adds what the next step depends on, the model's weights aside.
    virtual void save(TensorFile& file) const = 0;
    /// Goes on from what `save` wrote; what the file does not have begins anew. Throws FileError naming `source` and what does
    /// not fit.
    virtual void load(const TensorFile& file, const std::string& source) = 0;
};

/// Gradients of a batch as the mean of those of its micro-batches, equally large.
class GradientMean {
public:
    explicit GradientMean(std::size_t micro_batches)
        : part_(1.0 / static_cast<double>(micro_batches)), compensated_(micro_batches > most_plain_sums) {}

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
    std::vector<Variable> excess_;  ///< by which each sum is too large (Kahan 1965); empty unless compensated
};

/// What is not finite in an update, if anything is.
[[nodiscard]] std::optional<std::string> non_finite(double loss, const std::vector<Parameter>& parameters,
                                                    const std::vector<Variable>& gradients);

/// Adam's step in which the parameters whose name begins with `prefix` have another rate than the rest.
void step_in_two_groups(Adam& adam, const std::vector<Parameter>& parameters, const std::vector<Variable>& gradients,
                        double learning_rate, std::string_view prefix, double prefix_learning_rate);

}  // namespace stymo
