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

/// A split of a folder of faces at the model's resolution, without the faces that the model cannot
/// render. Throws what Dataset throws.
[[nodiscard]] Dataset faces_for_training(const std::filesystem::path& folder,
                                         const TrainConfig& config, Split split);

struct TrainingLimits {
    double minutes = 0.0;  ///< stop after this time; 0: no limit
};

/// How a run ended.
struct TrainingOutcome {
    std::int64_t steps = 0;
    double seconds = 0.0;  ///< duration of this call
    double images_per_second = 0.0;
    std::optional<LossValues> last_tick{};  ///< nothing if this call did no step
    bool finished = false;                  ///< all steps of the configuration are done
};

/// Trains a model on a data set in both stages and writes the run folder.
///
/// The n-th step is a pure function of the state before it and the seed. Stopping after any step
/// and resuming with the same number of threads therefore gives the same bits as not stopping.
class Trainer {
public:
    /// Without `validation` (null) no best model is chosen, and the sample sheets show training
    /// images. Without `ranks` (null) this process trains alone. Data sets and ranks must outlive
    /// the trainer. Throws what Model, ReconstructionLoss and `require_share` throw, and
    /// ConfigError if codes should come from the data but a face has none, if the backbone's
    /// weights are missing, or if no recomputation makes a step fit into the memory budget.
    Trainer(const TrainConfig& config, const Dataset& training, const Dataset* validation,
            std::uint64_t seed, Ranks* ranks = nullptr);
    ~Trainer();
    Trainer(const Trainer&) = delete;
    Trainer& operator=(const Trainer&) = delete;

    /// Begins with the weights of a model of the same shape instead of random ones. Returns a
    /// warning if that model knows photos of another focal length; empty: none. Throws what
    /// Model::load and ParameterStore::load throw.
    [[nodiscard]] std::string begin_with(const std::filesystem::path& model_file);
    /// Continues from a checkpoint of a model of the same shape. State that the checkpoint lacks
    /// because its run did not use it (an EMA of the weights, a discriminator, the second stage's
    /// optimisers) is initialised. Throws FileError for a checkpoint that is damaged, does not
    /// match or was made with another seed. Returns what follow_photos says of the photos.
    std::string resume(const std::filesystem::path& folder);
    /// Trains until the configured steps are done, the time is up or the process is interrupted.
    /// Writes checkpoints at the configured intervals, at the end of each phase and at the end.
    /// Throws NumericError after too many consecutive steps without a finite loss and gradient, and
    /// if the loss explodes (LossWatch), without a checkpoint of the exploding steps.
    TrainingOutcome run(const RunFolder& folder, const TrainingLimits& limits) {
        return run_steps(&folder, limits);
    }
    /// The same steps on a rank that does not lead. It writes nothing and follows the limits of the
    /// leading rank.
    TrainingOutcome follow() { return run_steps(nullptr, {}); }
    /// One successful optimiser step without any output, for plans and tests.
    StepReport step();
    /// Continues at this step with the current weights, for plans.
    void skip_to(std::int64_t step) { state_.step = step; }

    [[nodiscard]] const Model& model() const { return model_; }
    [[nodiscard]] const TrainingState& state() const { return state_; }
    [[nodiscard]] const TrainingSchedule& schedule() const { return schedule_; }
    [[nodiscard]] const ReconstructionLoss& reconstruction() const { return reconstruction_; }
    /// What is learnt for the photos (PhotoOffsets), in numbers.
    [[nodiscard]] std::int64_t offset_numbers() const {
        return offsets_ ? offsets_->element_count() : 0;
    }

private:
    /// During its lifetime the model is frozen and holds the EMA of its weights, if there is one,
    /// for samples, validation and saved models.
    class EvaluationScope {
    public:
        explicit EvaluationScope(Trainer& trainer);
        ~EvaluationScope();
        EvaluationScope(const EvaluationScope&) = delete;
        EvaluationScope& operator=(const EvaluationScope&) = delete;

    private:
        Trainer& trainer_;
    };

    class Run;

    [[nodiscard]] const Dataset& shown_faces() const {
        return validation_ != nullptr ? *validation_ : training_;
    }
    /// The learnt offsets of `shown_faces`.
    [[nodiscard]] const PhotoOffsets* shown_offsets() const {
        return validation_ == nullptr && offsets_ ? &*offsets_ : nullptr;
    }
    /// `folder`: null on a rank that does not lead.
    TrainingOutcome run_steps(const RunFolder* folder, const TrainingLimits& limits);
    /// The phase of the last step, whose resolution the model has learnt.
    [[nodiscard]] TrainingPhase phase_done() const;
    [[nodiscard]] double epochs_at(std::int64_t step) const {
        return images_.epochs(schedule_.images_before(step));
    }
    [[nodiscard]] double average_half_life(const TrainingPosition& position) const;
    /// Offsets of zero for the photos' codes, if the configuration learns them, their poses and the
    /// lights of their sources.
    void create_offsets(bool poses);
    /// Creates the objects that the stage of the next step needs, and releases those that no later
    /// step needs.
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
    std::optional<IdentityNetwork> identity_;
    std::optional<PhotoOffsets> offsets_;
    int stage_number_ = 0;  ///< 0 before the first step
    std::unique_ptr<TrainingStage> stage_;
    std::optional<Ema> ema_;
    TrainingState state_;
};

}  // namespace stymo
