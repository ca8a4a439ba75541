#include <algorithm>
#include <cmath>

#include "apps/bench/small_model.h"
#include "apps/bench/study.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/folder_in_progress.h"
#include "train/tick.h"
#include "train/trainer.h"

namespace stymo {

namespace {

constexpr std::int64_t most_samples = 64;

struct Heads {
    Dataset training;
    Dataset validation;
};

/// In a folder that is removed again: small data sets are decoded at once.
Heads synthetic_heads(std::uint64_t seed) {
    const FolderInProgress folder(std::filesystem::temp_directory_path() / "stymo-report-heads");
    write_small_heads(folder.path(), seed);
    const TrainConfig config = small_training(1, most_samples);
    const std::int64_t side = config.model.decoder.resolution;
    return {Dataset(folder.path(), side, config.data, Split::training),
            Dataset(folder.path(), side, config.data, Split::test)};
}

ValidationScore score_of(const Trainer& trainer, const Dataset& faces, std::int64_t samples) {
    return validation_score(trainer.model(), trainer.reconstruction(), faces, faces.size(),
                            trainer.model().config().decoder.resolution, samples);
}

double time_of_step(const Heads& data, std::int64_t samples, std::uint64_t seed) {
    Trainer trainer(small_training(1000, samples), data.training, nullptr, seed);
    static_cast<void>(trainer.step());
    constexpr int steps = 4;
    const double begin = seconds_now();
    for (int i = 0; i < steps; ++i) static_cast<void>(trainer.step());
    return (seconds_now() - begin) / steps;
}

/// Trains for `seconds`, in which the learning rate falls to zero; the points go to `curves`.
Row train(const Heads& data, std::int64_t samples, double seconds, std::uint64_t seed,
          Table& curves) {
    const double step_time = time_of_step(data, samples, seed);
    const auto steps = static_cast<std::int64_t>(std::clamp(seconds / step_time, 10.0, 3200.0));
    const TrainConfig config = small_training(steps, samples);
    Trainer trainer(config, data.training, nullptr, seed);
    double spent = 0.0;
    ValidationScore score;
    constexpr std::int64_t points = 24;
    for (std::int64_t step = 1; step <= steps; ++step) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        const double begin = seconds_now();
        static_cast<void>(trainer.step());
        spent += seconds_now() - begin;
        if (step * points / steps == (step - 1) * points / steps) continue;
        score = score_of(trainer, data.validation, samples);
        curves.rows.push_back({samples, step, spent, score.reconstruction, score.psnr});
    }
    return {spent / static_cast<double>(steps),
            steps,
            steps * config.stage1.batch,
            spent,
            score.reconstruction,
            score.psnr,
            score_of(trainer, data.validation, most_samples).psnr};
}

void write_training(Page& page, const StudyInputs& inputs) {
    const Heads data = synthetic_heads(inputs.seed);
    Table curves{
        .name = "training_curves",
        .columns = {{"samples"}, {"steps"}, {"seconds"}, {"reconstruction_loss"}, {"psnr_db"}}};
    // The rest of the time goes to the heads and to the scores.
    const double seconds = 0.8 * inputs.seconds / 3.0;
    std::vector<StudyRow> rows;
    for (const std::int64_t samples : {std::int64_t{16}, std::int64_t{32}, most_samples})
        rows.push_back({{samples}, [&, samples] {
                            return train(data, samples, seconds, inputs.seed, curves);
                        }});
    const Table ends = run_study({.name = "training",
                                  .columns = {{"samples", "N"},
                                              {"seconds_per_step", "ms a step", milliseconds},
                                              {"steps", "steps"},
                                              {"images", "images"},
                                              {"seconds", "seconds", fixed<1>},
                                              {"reconstruction_loss", "loss", fixed<4>},
                                              {"psnr_db", "PSNR dB", fixed<2>},
                                              {"psnr_64_db", "PSNR dB with N = 64", fixed<2>}}},
                                 rows);
    const std::string held_out = std::to_string(data.validation.size());
    page.text("The first stage with N samples per ray: the model of `configs/demo-64.json` on " +
              std::to_string(data.training.size()) +
              " synthetic heads, for the same time with each N; the learning rate falls to zero in "
              "that time. The loss is the reconstruction loss of " +
              held_out +
              " held-out heads with N samples too; measuring it does not count as time. Training "
              "computes in float32; training in 16 bits does not exist here.");
    Plot plot = plot_of(curves, {.series = "samples", .x = "seconds", .y = "reconstruction_loss"},
                        {.title = "Loss against seconds of training",
                         .x_label = "seconds of training",
                         .y_label = "reconstruction loss of " + held_out + " held-out heads",
                         .series = {},
                         .x_scale = PlotScale::linear});
    for (PlotSeries& series : plot.series) series.name = "N = " + series.name;
    page.plot("training_loss", plot);
    page.add(ends);
    page.add(curves);
}

}  // namespace

Study training_study() {
    return {.name = "training", .title = "Training", .seconds = 100.0, .write = write_training};
}

}  // namespace stymo
