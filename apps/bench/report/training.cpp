#include "apps/bench/report/training.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "apps/bench/report.h"
#include "apps/bench/report/small_model.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/folder_in_progress.h"
#include "train/trainer.h"
#include "train/validation.h"

namespace stymo {

namespace {

constexpr std::array<std::int64_t, 3> sample_counts{16, 32, 64};
constexpr std::int64_t most_samples = sample_counts.back();

struct TrainingPoint {
    std::int64_t steps = 0;
    double seconds = 0.0;  ///< of the steps alone
    ValidationScore score;
};

/// One training.
struct TrainingCurve {
    std::int64_t samples = 0;
    double seconds_per_step = 0.0;
    std::int64_t batch = 0;
    std::vector<TrainingPoint> points;
    ValidationScore with_most_samples;  ///< at the end
};

struct Heads {
    Dataset training;
    Dataset validation;
};

/// In a folder that is gone again afterwards: small sets are decoded at once.
Heads synthetic_heads(const ReportInputs& inputs) {
    const FolderInProgress folder(std::filesystem::temp_directory_path() / "stymo-report-heads");
    write_small_heads(folder.path(), inputs.seed);
    const DataConfig config = small_training(1, most_samples).data;
    return {Dataset(folder.path(), small_side, config, Split::training), Dataset(folder.path(), small_side, config, Split::test)};
}

ValidationScore score_of(const Trainer& trainer, const Dataset& faces, std::int64_t samples) {
    return validation_score(trainer.model(), trainer.reconstruction(), faces, faces.size(), small_side, samples);
}

double time_of_step(const Heads& data, std::int64_t samples, std::uint64_t seed) {
    Trainer trainer(small_training(1000, samples), data.training, nullptr, seed);
    static_cast<void>(trainer.step());
    constexpr int steps = 4;
    const double begin = seconds_now();
    for (int i = 0; i < steps; ++i) static_cast<void>(trainer.step());
    return (seconds_now() - begin) / steps;
}

TrainingCurve train(const Heads& data, std::int64_t samples, double seconds, std::uint64_t seed) {
    // The learning rate reaches zero when the time is up, whatever a step costs.
    const double step_time = time_of_step(data, samples, seed);
    const auto steps = static_cast<std::int64_t>(std::clamp(seconds / step_time, 10.0, 3200.0));
    const TrainConfig config = small_training(steps, samples);
    Trainer trainer(config, data.training, nullptr, seed);
    TrainingCurve curve{.samples = samples, .batch = config.stage1.batch, .points = {}, .with_most_samples = {}};
    double spent = 0.0;
    constexpr std::int64_t points = 24;
    for (std::int64_t step = 1; step <= steps; ++step) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        const double begin = seconds_now();
        static_cast<void>(trainer.step());
        spent += seconds_now() - begin;
        if (step * points / steps == (step - 1) * points / steps) continue;
        curve.points.push_back({step, spent, score_of(trainer, data.validation, samples)});
    }
    curve.seconds_per_step = spent / static_cast<double>(steps);
    curve.with_most_samples = score_of(trainer, data.validation, most_samples);
    return curve;
}

std::string name_of(const TrainingCurve& curve) {
    return "N = " + std::to_string(curve.samples);
}

Plot plot_of(const std::vector<TrainingCurve>& curves) {
    Plot plot{.title = "Loss against seconds of training",
              .x_label = "seconds of training",
              .y_label = "reconstruction loss on " + std::to_string(small_held_out) + " held-out heads",
              .series = {},
              .x_scale = PlotScale::linear,
              .y_scale = PlotScale::logarithmic};
    for (const TrainingCurve& curve : curves) {
        plot.series.push_back({name_of(curve), {}});
        for (const TrainingPoint& point : curve.points)
            plot.series.back().points.push_back({point.seconds, point.score.reconstruction, ""});
    }
    return plot;
}

void write_curves(ReportWriter& report, const std::vector<TrainingCurve>& curves) {
    std::vector<std::vector<ReportCell>> rows, ends;
    for (const TrainingCurve& curve : curves) {
        for (const TrainingPoint& point : curve.points)
            rows.push_back({curve.samples, point.steps, point.seconds, point.score.reconstruction, point.score.psnr});
        const TrainingPoint& last = curve.points.back();
        ends.push_back({curve.samples,
                        {decimal(curve.seconds_per_step * 1e3, 1), curve.seconds_per_step},
                        last.steps,
                        last.steps * curve.batch,
                        {decimal(last.seconds, 1), last.seconds},
                        {decimal(last.score.reconstruction, 4), last.score.reconstruction},
                        {decimal(last.score.psnr, 2), last.score.psnr},
                        {decimal(curve.with_most_samples.psnr, 2), curve.with_most_samples.psnr}});
    }
    report.table(
        "training",
        {"N", "ms a step", "steps", "images", "seconds", "loss", "PSNR dB", "PSNR dB with N = " + std::to_string(most_samples)},
        ends);
    report.data("training_curves", {"samples", "steps", "seconds", "reconstruction_loss", "psnr_db"}, rows);
}

void write_training(ReportWriter& report, const ReportInputs& inputs) {
    const InterruptGuard guard;
    const Heads data = synthetic_heads(inputs);
    std::vector<TrainingCurve> curves;
    // What is left goes to the heads and to the scores.
    const double seconds = 0.8 * inputs.seconds / static_cast<double>(sample_counts.size());
    for (const std::int64_t samples : sample_counts) curves.push_back(train(data, samples, seconds, inputs.seed));
    report.text(
        "The first stage with N samples on a ray: the model of `configs/demo-64.json` on " +
        std::to_string(small_heads - small_held_out) + " synthetic heads of " + std::to_string(small_side) +
        " pixels, for the same time with each N; the learning rate falls to zero in that time. The loss is that of "
        "reconstruction on " +
        std::to_string(small_held_out) +
        " heads that are held out, with N samples too; scores do not count as time. All of it is float32: training in 16 bits "
        "does not exist here.");
    report.plot("training", plot_of(curves));
    write_curves(report, curves);
}

}  // namespace

ReportSection training_section() {
    constexpr double seconds = 100.0;
    return {.name = "training", .title = "Training", .seconds = seconds, .write = write_training};
}

}  // namespace stymo
