#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "nn/optim/ema.h"
#include "train/checkpoint.h"
#include "train/data/dataset.h"
#include "train/run_folder.h"
#include "train/schedule.h"
#include "train/stage.h"
#include "train/tick.h"
#include "train/train_config.h"

namespace stymo {

/// A split of a folder of faces at the model's resolution, without those that the model cannot
/// render. Throws what Dataset throws.
[[nodiscard]] Dataset faces_for_training(const std::filesystem::path& folder,
                                         const TrainConfig& config, Split split);

struct TrainingLimits {
    double minutes = 0.0;  ///< stop after so long; 0: no limit
};

/// How a run ended.
struct TrainingOutcome {
    std::int64_t steps = 0;
    double seconds = 0.0;  ///< of this call
    double images_per_second = 0.0;
    LossValues last_tick;
    bool finished = false;  ///< all steps of the configuration are done
};

/// Trains a model on a data set through both stages and writes the run folder.
///
/// The n-th step is a pure function of the state before it and the seed: stopping at any step and
/// resuming gives the same bits as never having stopped, at any thread count that is the same for
/// both, within a stage or across its end.
class Trainer {
public:
    /// `validation` may be null: then no best model is chosen, and the sample sheets show training
    /// images. Both must outlive the trainer. Throws what Model and ReconstructionLoss throw, and
    /// ConfigError if codes are to come from the data and faces have none, if the weights of the
    /// backbone are missing, or if no recomputation makes a step fit the memory budget. `ranks` may
    /// be null: then this process trains alone. Throws what `require_share` throws.
    Trainer(const TrainConfig& config, const Dataset& training, const Dataset* validation,
            std::uint64_t seed, Ranks* ranks = nullptr);
    ~Trainer();
    Trainer(const Trainer&) = delete;
    Trainer& operator=(const Trainer&) = delete;

    /// Begins with the weights of a model of the same shape instead of random ones. Throws what
    /// Model::load and ParameterStore::load throw.
    void begin_with(const std::filesystem::path& model_file);
    /// Continues from a checkpoint of a model of the same shape. Parts that the checkpoint lacks
    /// because its run had no use for them (an EMA of the weights, a discriminator, the second
    /// stage's optimisers) begin here.
    void resume(const std::filesystem::path& folder);
    /// Trains until the configured steps are done, the time is up or the process is asked to stop;
    /// writes checkpoints on the way, at the end of each phase and at the end. Throws NumericError
    /// after too many steps in a row without a finite gradient.
    TrainingOutcome run(const RunFolder& folder, const TrainingLimits& limits) {
        return run_steps(&folder, limits);
    }
    /// The same steps on a rank that does not lead. Writes nothing; the leading rank's limits
    /// count.
    TrainingOutcome follow() { return run_steps(nullptr, {}); }
    /// One optimiser step that counts; without any output. For plans and tests.
    StepReport step();
    /// Goes on from this step with the weights as they are, for plans.
    void skip_to(std::int64_t step) { state_.step = step; }

    [[nodiscard]] const Model& model() const { return model_; }
    [[nodiscard]] const TrainingState& state() const { return state_; }
    [[nodiscard]] const TrainingSchedule& schedule() const { return schedule_; }
    [[nodiscard]] const ReconstructionLoss& reconstruction() const { return reconstruction_; }

private:
    /// While it lives the model is frozen and holds the EMA of its weights, if there is one: what
    /// is shown, measured and saved for use.
    class EvaluationScope {
    public:
        explicit EvaluationScope(Trainer& trainer);
        ~EvaluationScope();
        EvaluationScope(const EvaluationScope&) = delete;
        EvaluationScope& operator=(const EvaluationScope&) = delete;

    private:
        Trainer& trainer_;
    };

    [[nodiscard]] const Dataset& shown_faces() const {
        return validation_ != nullptr ? *validation_ : training_;
    }
    /// Of the codes of `shown_faces`.
    [[nodiscard]] const CodeOffsets* shown_offsets() const {
        return validation_ == nullptr && offsets_ ? &*offsets_ : nullptr;
    }
    /// `folder`: null on a rank that does not lead.
    TrainingOutcome run_steps(const RunFolder* folder, const TrainingLimits& limits);
    /// The phase that the model has come out of, which is what it is good for.
    [[nodiscard]] TrainingPhase phase_done() const;
    [[nodiscard]] double epochs_at(std::int64_t step) const {
        return images_.epochs(schedule_.images_before(step));
    }
    [[nodiscard]] double average_half_life(const TrainingPosition& position) const;
    /// Makes what the stage of the next step needs and drops what no step will need again.
    void enter_stage(int stage);
    void count_failure(const std::string& what);
    void count_epoch(double reconstruction_loss);
    /// Also scores the model on the validation images, if there are any.
    void save_checkpoint(const RunFolder& folder);

    OneRank alone_;
    Ranks& ranks_;
    TrainConfig config_;
    const Dataset& training_;
    const Dataset* validation_;
    Rng rng_;
    TrainingSchedule schedule_;
    TrainingImages images_;
    Model model_;
    ReconstructionLoss reconstruction_;
    std::optional<CodeOffsets> offsets_;
    int stage_number_ = 0;  ///< 0 before the first step
    std::unique_ptr<TrainingStage> stage_;
    std::optional<Ema> ema_;
    TrainingState state_;
};

}  // namespace stymo
