#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "nn/optim/adam.h"
#include "nn/optim/ema.h"
#include "train/checkpoint.h"
#include "train/dataset.h"
#include "train/reconstruction_stage.h"
#include "train/run_folder.h"
#include "train/train_config.h"

namespace stymo {

struct TrainingLimits {
    double minutes = 0.0;  ///< stop after so long; 0: no limit
};

/// How a run ended.
struct TrainingOutcome {
    std::int64_t steps = 0;
    double seconds = 0.0;  ///< of this call
    double images_per_second = 0.0;
    LossTerms last_tick;
    bool finished = false;  ///< all steps of the configuration are done
};

/// The first stage: trains encoder and decoder on a data set and keeps the run folder.
///
/// The n-th step is a pure function of the state before it and the seed: stopping at any step and resuming gives the same bits
/// as never having stopped, at any thread count that is the same for both.
class Trainer {
public:
    /// `validation` may be null: then no best model is chosen, and the sample sheets show training images. Both outlive this.
    Trainer(const TrainConfig& config, const Dataset& training, const Dataset* validation, std::uint64_t seed);

    /// Continues from a checkpoint of the same configuration.
    void resume(const std::filesystem::path& checkpoint);
    /// Trains until the configured steps are done, the time is up or the process is asked to stop; writes checkpoints on the way
    /// and one at the end. Throws NumericError after too many steps in a row without a finite gradient.
    TrainingOutcome run(const RunFolder& folder, const TrainingLimits& limits);
    /// One optimiser step that counts; without any output. For plans and tests.
    LossTerms step();

    [[nodiscard]] const Model& model() const { return model_; }
    [[nodiscard]] const TrainingState& state() const { return state_; }

private:
    /// While it lives the model is frozen and holds the averaged weights, if there are any: what is shown, measured and saved
    /// for use.
    class EvaluationScope {
    public:
        explicit EvaluationScope(Trainer& trainer);
        ~EvaluationScope();
        EvaluationScope(const EvaluationScope&) = delete;
        EvaluationScope& operator=(const EvaluationScope&) = delete;

    private:
        Trainer& trainer_;
    };

    [[nodiscard]] const Dataset& shown_faces() const { return validation_ != nullptr ? *validation_ : training_; }
    /// Mean PSNR of the initial codes on the validation images, masked; nothing without such images.
    [[nodiscard]] std::optional<double> validate() const;
    [[nodiscard]] double epochs_at(std::int64_t step) const;
    [[nodiscard]] double learning_rate() const;
    [[nodiscard]] TrainingBatch batch_at(std::int64_t first_image) const;
    void set_trainable_parts();
    void apply(const std::vector<Parameter>& parameters, const std::vector<Variable>& gradients);
    void count_epoch(double reconstruction_loss);
    void save_checkpoint(const RunFolder& folder);

    TrainConfig config_;
    const Dataset& training_;
    const Dataset* validation_;
    Rng rng_;
    Model model_;
    Adam adam_;
    std::optional<Ema> average_;
    TrainingState state_;
};

}  // namespace stymo
