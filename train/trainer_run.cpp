#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "core/clock.h"
#include "core/interrupt.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "train/sample_sheet.h"
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

}  // namespace

TrainingOutcome Trainer::run_steps(const RunFolder* folder, const TrainingLimits& limits) {
    const InterruptGuard guard;
    const OutputConfig& output = config_.output;
    const double start = seconds_now();
    const std::int64_t first_image = schedule_.images_before(state_.step);
    double last_checkpoint = start;
    std::int64_t saved_step = -1;
    double tick_start = start;
    double tick_exchange = ranks_.exchange_seconds(), tick_hidden = ranks_.hidden_seconds();
    double tick_waiting = images_.waiting_seconds();
    bool disk_is_slow = false;
    std::int64_t tick_first_image = first_image;
    if (folder != nullptr) folder->forget_statistics_after(state_.step);
    Progress progress({.title = "train",
                       .total = schedule_.images_before(schedule_.steps()),
                       .first = first_image,
                       .unit = "images",
                       .time_limit = limits.minutes * 60.0});
    if (folder != nullptr) announce_lpips(reconstruction_.lpips(), *folder, progress);
    TrainingOutcome outcome;
    Tick tick;
    // All ranks stop before the same step.
    const auto time_is_up = [&] {
        const bool late = limits.minutes > 0.0 && seconds_now() - start >= limits.minutes * 60.0;
        return any(ranks_, late || interrupted());
    };
    while (state_.step < schedule_.steps() && !time_is_up()) {
        const TrainingPosition position = schedule_.position(state_.step);
        const StepReport report = step();
        const std::int64_t images = schedule_.images_before(state_.step);
        if (report.non_finite) {
            progress.message("step " + std::to_string(state_.step) +
                             " skipped: " + *report.non_finite + " is not finite");
        }
        tick.add(report);
        if (is_due(state_.step, output.tick_steps)) {
            const double seconds = seconds_now() - tick_start;
            TickSpeed speed{static_cast<double>(images - tick_first_image) / seconds};
            if (ranks_.size() > 1) {
                const double hidden = ranks_.hidden_seconds() - tick_hidden;
                speed.hidden_exchange_share = hidden / seconds;
                speed.exchange_share =
                    (ranks_.exchange_seconds() - tick_exchange - hidden) / seconds;
            }
            speed.disk_share = (images_.waiting_seconds() - tick_waiting) /
                               (seconds * static_cast<double>(thread_count()));
            constexpr double slow_from = 0.2;
            if (speed.disk_share > slow_from && !disk_is_slow) {
                disk_is_slow = true;
                announce_slow_disk(speed.disk_share, folder, progress);
            }
            if (folder != nullptr) {
                folder->statistics(tick.json(state_.step, position, images_.epochs(images), speed));
                folder->log("step " + std::to_string(state_.step) + ": " + tick.text());
            }
            outcome.last_tick = tick.losses();
            tick = {};
            tick_start = seconds_now();
            tick_exchange = ranks_.exchange_seconds();
            tick_hidden = ranks_.hidden_seconds();
            tick_waiting = images_.waiting_seconds();
            tick_first_image = images;
        }
        progress.update(images, step_text(report.losses));
        if (folder == nullptr) continue;
        if (is_due(state_.step, output.sample_steps)) {
            const EvaluationScope evaluation(*this);
            folder->sample(state_.step,
                           sample_sheet(model_, shown_faces(), position.phase.resolution,
                                        position.phase.samples_per_ray, shown_offsets()));
        }
        const bool time_to_save =
            output.checkpoint_minutes > 0.0 &&
            seconds_now() - last_checkpoint >= output.checkpoint_minutes * 60.0;
        const bool phase_is_over = position.step + 1 == position.phase.steps;
        if (time_to_save || phase_is_over || is_due(state_.step, output.checkpoint_steps)) {
            save_checkpoint(*folder);
            saved_step = state_.step;
            last_checkpoint = seconds_now();
        }
    }
    outcome.steps = state_.step;
    outcome.seconds = seconds_now() - start;
    outcome.images_per_second =
        static_cast<double>(schedule_.images_before(state_.step) - first_image) /
        std::max(1e-9, outcome.seconds);
    outcome.finished = state_.step >= schedule_.steps();
    if (tick.steps() > 0 && outcome.last_tick.total == 0.0) outcome.last_tick = tick.losses();
    if (folder == nullptr) return outcome;
    if (saved_step != state_.step) save_checkpoint(*folder);
    // Only at the end, because the statistics take as long as many steps; and after the checkpoint,
    // in case the process is killed meanwhile.
    for (const std::filesystem::path& model : {folder->model_file(), folder->best_file()})
        add_code_statistics(model, training_, output.statistics_images);
    progress.finish(step_text(outcome.last_tick));
    return outcome;
}

}  // namespace stymo
