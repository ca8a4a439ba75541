#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/progress.h"
#include "train/tick.h"
#include "train/trainer.h"
#include "train/training_codes.h"

namespace stymo {

namespace {

std::string step_text(const LossValues& losses) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << "loss " << losses.total << ", reconstruction "
         << losses["reconstruction"];
    return text.str();
}

/// Tells the user if the weights are random.
void announce_lpips(const Lpips* lpips, const RunFolder& folder, Progress& progress) {
    if (lpips == nullptr) return;
    const std::string line = "LPIPS: " + lpips->label();
    folder.log(line);
    if (lpips->random()) progress.message(line);
}

/// Tells the user if the disk slows the training down.
void announce_slow_disk(double share, const RunFolder* folder, Progress& progress) {
    std::ostringstream line;
    line << "reading photos takes " << std::lround(100.0 * share)
         << " % of the time: the disk is slow; copy the data to a faster one, or give "
            "data.cache_megabytes more memory";
    progress.message(line.str());
    if (folder != nullptr) folder->log(line.str());
}

bool is_due(std::int64_t step, std::int64_t interval) {
    return interval > 0 && step % interval == 0;
}

bool is_last(const TrainingPosition& position) {
    return position.step + 1 == position.phase.steps;
}

}  // namespace

/// A call of run_steps: its clocks, and what it reports and writes.
class Trainer::Run {
public:
    Run(Trainer& trainer, const RunFolder* folder, const TrainingLimits& limits);

    /// The same on all ranks, which therefore stop before the same step.
    [[nodiscard]] bool time_is_up();
    void step();
    [[nodiscard]] TrainingOutcome finish();

private:
    /// Says how many photos can be used as the shares in DataConfig ask.
    void announce_photos();
    [[nodiscard]] std::int64_t images_done() const {
        return trainer_.schedule_.images_before(trainer_.state_.step);
    }
    /// Both throw NumericError if the loss explodes (LossWatch).
    void watch(const TrainingPosition& position, const StepReport& report);
    void require_sound_loss(std::int64_t most) const;
    void end_tick(const TrainingPosition& position);
    void write_samples(const TrainingPhase& phase);
    [[nodiscard]] bool checkpoint_is_due(const TrainingPosition& done) const;
    void save_checkpoint();

    Trainer& trainer_;
    const RunFolder* folder_;  ///< null on a rank that does not lead
    double limit_;             ///< seconds; 0: none
    double start_;
    double last_checkpoint_;
    std::int64_t saved_step_ = -1;
    std::int64_t first_image_;
    bool disk_is_slow_ = false;
    Progress progress_;
    TickClock clock_;
    Tick tick_;
    LossWatch watch_;
    double last_loss_ = 0.0;
    TrainingOutcome outcome_;
};

Trainer::Run::Run(Trainer& trainer, const RunFolder* folder, const TrainingLimits& limits)
    : trainer_(trainer),
      folder_(folder),
      limit_(limits.minutes * 60.0),
      start_(seconds_now()),
      last_checkpoint_(start_),
      first_image_(images_done()),
      progress_({.title = "train",
                 .total = trainer.schedule_.images_before(trainer.schedule_.steps()),
                 .first = first_image_,
                 .unit = "images",
                 .time_limit = limit_}),
      clock_(trainer.images_, trainer.ranks_, first_image_) {
    if (folder_ == nullptr) return;
    folder_->forget_statistics_after(trainer_.state_.step);
    announce_lpips(trainer_.reconstruction_.lpips(), *folder_, progress_);
    announce_photos();
}

void Trainer::Run::announce_photos() {
    const auto announce = [this](double share, const char* key, std::int64_t photos,
                                 const char* what) {
        if (share == 0.0) return;
        const std::string text = std::string(key) + ": " + std::to_string(photos) + " of " +
                                 std::to_string(trainer_.training_.size()) + " photos " + what;
        folder_->log(text);
        progress_.message(text);
    };
    const DataConfig& data = trainer_.config_.data;
    announce(data.other_photo, "data.other_photo", trainer_.images_.photos_with_partner(),
             "have another one of the same person");
    announce(data.turned_photos, "data.turned_photos", trainer_.images_.photos_to_turn(),
             "have a pose and a code, so that they can be shown turned");
}

bool Trainer::Run::time_is_up() {
    const bool late = limit_ > 0.0 && seconds_now() - start_ >= limit_;
    return any(trainer_.ranks_, late || interrupted());
}

void Trainer::Run::step() {
    const OutputConfig& output = trainer_.config_.output;
    const TrainingPosition position = trainer_.schedule_.position(trainer_.state_.step);
    const StepReport report = trainer_.step();
    const std::int64_t steps = trainer_.state_.step;
    watch(position, report);
    if (report.non_finite) {
        progress_.message("step " + std::to_string(steps) + " skipped: " + *report.non_finite +
                          " is not finite");
    }
    tick_.add(report);
    // A line of statistics is of one phase.
    if (is_due(steps, output.tick_steps) || is_last(position)) end_tick(position);
    progress_.update(images_done(), step_text(report.losses));
    if (folder_ == nullptr) return;
    if (is_due(steps, output.sample_steps)) write_samples(position.phase);
    if (checkpoint_is_due(position)) save_checkpoint();
}

void Trainer::Run::watch(const TrainingPosition& position, const StepReport& report) {
    if (position.step == 0) watch_ = {};
    if (report.non_finite) return;
    last_loss_ = report.losses.total + report.losses["discriminator"];
    watch_.add(last_loss_);
    require_sound_loss(LossWatch::most);
}

void Trainer::Run::require_sound_loss(std::int64_t most) const {
    if (watch_.high_steps() < most) return;
    const bool resumable = saved_step_ > 0 || first_image_ > 0;
    fail<NumericError>(
        "step ", trainer_.state_.step, ": the loss is ", last_loss_, ", above ", LossWatch::factor,
        " times the lowest of this phase (", watch_.lowest(), ") in ", watch_.high_steps(),
        " steps in a row; lower ", trainer_.stage_->learning_rate_key(),
        resumable ? " and continue from an earlier checkpoint (--resume)" : " and start again");
}

void Trainer::Run::end_tick(const TrainingPosition& position) {
    const std::int64_t steps = trainer_.state_.step;
    // A micro-batch loads its own photos.
    const TickSpeed speed =
        clock_.lap(images_done(), position.phase.execution.at_once(position.phase));
    constexpr double slow_from = 0.2;
    if (speed.disk_share > slow_from && !disk_is_slow_) {
        disk_is_slow_ = true;
        announce_slow_disk(speed.disk_share, folder_, progress_);
    }
    if (folder_ != nullptr) {
        folder_->statistics(tick_.json(steps, position, trainer_.epochs_at(steps), speed));
        folder_->log("step " + std::to_string(steps) + ": " + tick_.text());
    }
    outcome_.last_tick = tick_.losses();
    tick_ = {};
}

void Trainer::Run::write_samples(const TrainingPhase& phase) {
    const EvaluationScope evaluation(trainer_);
    folder_->sample(trainer_.state_.step,
                    sample_sheet(trainer_.model_, trainer_.shown_faces(), phase.resolution,
                                 phase.samples_per_ray, trainer_.shown_offsets()));
}

bool Trainer::Run::checkpoint_is_due(const TrainingPosition& done) const {
    // A checkpoint of an exploding model would replace a good one.
    if (watch_.high_steps() > 0) return false;
    const OutputConfig& output = trainer_.config_.output;
    const bool time_to_save = output.checkpoint_minutes > 0.0 &&
                              seconds_now() - last_checkpoint_ >= output.checkpoint_minutes * 60.0;
    return time_to_save || is_last(done) || is_due(trainer_.state_.step, output.checkpoint_steps);
}

void Trainer::Run::save_checkpoint() {
    trainer_.save_checkpoint(*folder_);
    saved_step_ = trainer_.state_.step;
    last_checkpoint_ = seconds_now();
}

TrainingOutcome Trainer::Run::finish() {
    require_sound_loss(1);
    outcome_.steps = trainer_.state_.step;
    outcome_.seconds = seconds_now() - start_;
    outcome_.images_per_second =
        static_cast<double>(images_done() - first_image_) / std::max(1e-9, outcome_.seconds);
    outcome_.finished = trainer_.state_.step >= trainer_.schedule_.steps();
    if (tick_.steps() > 0 && !outcome_.last_tick) outcome_.last_tick = tick_.losses();
    if (folder_ == nullptr) return outcome_;
    if (saved_step_ != trainer_.state_.step) save_checkpoint();
    // Only at the end, because the statistics take as long as many steps; and after the checkpoint,
    // in case the process is killed meanwhile.
    if (interrupted())
        progress_.message(
            "the codes of the photos are measured for the model; a second signal leaves that out");
    for (const std::filesystem::path& model : {folder_->model_file(), folder_->best_file()})
        add_code_statistics(model, trainer_.training_, trainer_.config_.output.statistics_images);
    progress_.finish(outcome_.last_tick ? step_text(*outcome_.last_tick) : "");
    return outcome_;
}

TrainingOutcome Trainer::run_steps(const RunFolder* folder, const TrainingLimits& limits) {
    const InterruptGuard guard;
    Run run(*this, folder, limits);
    while (state_.step < schedule_.steps() && !run.time_is_up()) run.step();
    return run.finish();
}

}  // namespace stymo
