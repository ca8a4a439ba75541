#include <algorithm>
#include <array>

#include "apps/bench/embedded_configurations.h"
#include "apps/bench/study.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/folder_in_progress.h"
#include "core/matmul_precision.h"
#include "core/median.h"
#include "nn/pretrained/perceptual/trunk.h"
#include "render/morphable/builtin_head.h"
#include "train/data/synthetic_faces.h"
#include "train/trainer.h"

namespace stymo {

namespace {

/// A folder that is removed again. Small data sets are decoded at once, so they need it no longer.
FolderInProgress temporary_folder(const std::string& name) {
    return FolderInProgress(std::filesystem::temp_directory_path() / name);
}

/// The configuration configs/`name`.json with overrides "a.b=value".
TrainConfig embedded_configuration(const std::string& name,
                                   const std::vector<std::string>& overrides) {
    const FolderInProgress folder = temporary_folder("stymo-report-config");
    for (const auto& [file, text] : embedded_configurations) write_file(folder.path() / file, text);
    return load_train_config(folder.path() / (name + ".json"), overrides);
}

void write_heads(const std::filesystem::path& folder, const ModelConfig& model, std::int64_t count,
                 std::uint64_t seed) {
    write_synthetic_faces(
        builtin_head(),
        {.count = count, .side = model.decoder.resolution, .intrinsics = model.camera.intrinsics},
        Rng(seed).split("heads"), folder);
}

Dataset dataset(const std::filesystem::path& folder, const TrainConfig& config, Split split) {
    return Dataset(folder, config.model.decoder.resolution, config.data, split);
}

/// A step of the first stage as `stymo-train` does it. Of the work only decoder and trunk are
/// counted: forwards and twice as much backwards through the decoder; photo, image and back through
/// the trunk.
Measurement training_step(const BenchOptions& options, const std::string& configuration) {
    TrainingSteps steps(configuration, options.seed);
    Measurement result{.timing = time_repeated(options.repeats, 0.0,
                                               [&] { static_cast<void>(steps.trainer.step()); })};
    result.limit = limit_of(matmul_precision());
    const TrainConfig& config = steps.config;
    const auto trunk = static_cast<double>(trunk_multiply_adds(
        config.model.reconstruction.perceptual.network, config.model.decoder.resolution));
    result.work = 3.0 * static_cast<double>(config.stage1.batch) *
                  (frame_work(steps.trainer.model(), config.stage1.samples_per_ray) + trunk);
    return result;
}

constexpr std::int64_t most_samples = 64, small_head_count = 240;

struct Heads {
    Dataset training;
    Dataset validation;
};

Heads synthetic_heads(std::uint64_t seed) {
    const FolderInProgress folder = temporary_folder("stymo-report-heads");
    const TrainConfig config = small_training(1, most_samples);
    write_heads(folder.path(), config.model, small_head_count, seed);
    return {dataset(folder.path(), config, Split::training),
            dataset(folder.path(), config, Split::test)};
}

ValidationScore score_of(const Trainer& trainer, const Dataset& faces, std::int64_t samples) {
    return validation_score(trainer.model(), trainer.reconstruction(), faces, faces.size(),
                            trainer.model().config().decoder.resolution, samples);
}

/// Trains so many steps, or until `after`, which is given the steps and the seconds so far, returns
/// false. Its own time does not count. Returns the seconds of all steps.
double train(Trainer& trainer, std::int64_t steps,
             const std::function<bool(std::int64_t, double)>& after = {}) {
    double spent = 0.0;
    for (std::int64_t step = 1; step <= steps; ++step) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        const double begin = seconds_now();
        static_cast<void>(trainer.step());
        spent += seconds_now() - begin;
        if (after && !after(step, spent)) break;
    }
    return spent;
}

double time_of_step(const Heads& data, std::int64_t samples, std::uint64_t seed) {
    Trainer trainer(small_training(1000, samples), data.training, nullptr, seed);
    static_cast<void>(trainer.step());
    constexpr int steps = 4;
    return train(trainer, steps) / steps;
}

/// Trains for `seconds`, in which the learning rate falls to zero; the points go to `curves`.
Row trained_for(double seconds, const Heads& data, std::int64_t samples, std::uint64_t seed,
                Table& curves) {
    const double step_time = time_of_step(data, samples, seed);
    const auto steps = static_cast<std::int64_t>(std::clamp(seconds / step_time, 10.0, 3200.0));
    const TrainConfig config = small_training(steps, samples);
    Trainer trainer(config, data.training, nullptr, seed);
    ValidationScore score;
    constexpr std::int64_t points = 24;
    const double spent = train(trainer, steps, [&](std::int64_t step, double so_far) {
        if (step * points / steps == (step - 1) * points / steps) return true;
        score = score_of(trainer, data.validation, samples);
        curves.rows.push_back({samples, step, so_far, score.reconstruction, score.psnr});
        return true;
    });
    const double psnr_64 = score_of(trainer, data.validation, most_samples).psnr;
    return {spent / static_cast<double>(steps),
            steps,
            steps * config.stage1.batch,
            spent,
            score.reconstruction,
            score.psnr,
            psnr_64};
}

StudyPlan training_plan(const StudyInputs& inputs) {
    const auto data = std::make_shared<const Heads>(synthetic_heads(inputs.bench.seed));
    // The rest of the time goes to the heads and to the scores.
    const double seconds = 0.8 * inputs.seconds / 3.0;
    StudyPlan plan;
    plan.curves = std::make_shared<Table>(Table{
        "training_curves", {"samples", "steps", "seconds", "reconstruction_loss", "psnr_db"}});
    for (const std::int64_t samples : {std::int64_t{16}, std::int64_t{32}, most_samples})
        plan.add({samples}, [=, seed = inputs.bench.seed, curves = plan.curves] {
            return trained_for(seconds, *data, samples, seed, *curves);
        });
    plan.setting = "The model of `configs/demo-64.json` on " +
                   std::to_string(data->training.size()) + " synthetic heads, in float32, and " +
                   std::to_string(data->validation.size()) +
                   " held-out ones; the learning rate falls to zero in the time. Measuring the "
                   "loss does not count as time.";
    return plan;
}

/// What a step of training leaves out or rounds.
struct StepVariant {
    std::string name;
    MatmulPrecision precision = MatmulPrecision::highest;
    double sample_tolerance = 0.0;
};

StudyPlan step_plan(const StudyInputs& inputs) {
    constexpr std::int64_t samples = 16;
    constexpr double tolerance = 0.001;  // that of faces-256
    constexpr std::array<std::uint64_t, 3> seeds{1, 2, 3};
    const auto data = std::make_shared<const Heads>(synthetic_heads(inputs.bench.seed));
    std::vector<StepVariant> variants{{"every sample, float32"},
                                      {"samples left out", MatmulPrecision::highest, tolerance}};
    for (const auto precision : {MatmulPrecision::high, MatmulPrecision::medium}) {
        if (computed_precision(precision) != precision) continue;
        variants.push_back({name_of(precision), precision});
        variants.push_back(
            {name_of(precision) + std::string(", samples left out"), precision, tolerance});
    }
    const double runs = static_cast<double>(variants.size() * seeds.size());
    const auto steps = static_cast<std::int64_t>(
        std::clamp(0.8 * inputs.seconds / (runs * time_of_step(*data, samples, 1)), 10.0, 1000.0));
    StudyPlan plan;
    for (const StepVariant& variant : variants)
        plan.add({variant.name}, [=]() -> Row {
            const PrecisionScope scope(variant.precision);
            double seconds = 0.0;
            std::vector<double> psnr;
            for (const std::uint64_t seed : seeds) {
                TrainConfig config = small_training(steps, samples);
                config.optimizer.sample_tolerance = variant.sample_tolerance;
                Trainer trainer(config, data->training, nullptr, seed);
                seconds += train(trainer, steps) / static_cast<double>(seeds.size());
                psnr.push_back(score_of(trainer, data->validation, most_samples).psnr);
            }
            const auto [least, most] = std::ranges::minmax(psnr);
            return {seconds / static_cast<double>(steps), steps, median(psnr), least, most};
        });
    plan.setting = "The model of `configs/demo-64.json`, from the same three seeds for each row, " +
                   std::to_string(samples) +
                   " samples per ray. Samples are left out of the gradient below a weight of " +
                   significant(tolerance, 1) + ".";
    return plan;
}

Dataset heads_of(const TrainConfig& config, std::uint64_t seed) {
    const FolderInProgress folder = temporary_folder("stymo-bench-heads");
    write_heads(folder.path(), config.model, 2 * config.stage1.batch, seed);
    return dataset(folder.path(), config, Split::training);
}

}  // namespace

TrainingSteps::TrainingSteps(const std::string& configuration, std::uint64_t seed)
    : config(embedded_configuration(
          configuration,
          {"stage2.resolutions=[]", "data.split.test=0", "encoder.backbone_weights=random",
           "reconstruction.perceptual_trunk=random", "reconstruction.perceptual_heads=random"})),
      faces(heads_of(config, seed)),
      trainer(config, faces, nullptr, seed) {}

TrainConfig small_training(std::int64_t steps, std::int64_t samples_per_ray) {
    return embedded_configuration("demo-64",
                                  {"stage1.steps=" + std::to_string(steps),
                                   "stage1.samples_per_ray=" + std::to_string(samples_per_ray),
                                   "stage1.average_half_life=0"});
}

void train_small_subject(const std::filesystem::path& folder, BenchOptions& bench) {
    constexpr std::int64_t steps = 3200, samples = 16;
    constexpr double seconds = 45.0;
    bench.data = folder / "heads";
    bench.model = folder / "model.safetensors";
    std::filesystem::create_directory(bench.data);
    TrainConfig config = small_training(steps, samples);
    write_heads(bench.data, config.model, small_head_count, bench.seed);
    // The number of steps that fit into the time is not known beforehand.
    config.optimizer.schedule = "epoch";
    const Dataset faces = dataset(bench.data, config, Split::training);
    Trainer trainer(config, faces, nullptr, bench.seed);
    train(trainer, steps, [](std::int64_t, double spent) { return spent < seconds; });
    trainer.model().save(bench.model);
}

std::vector<SpeedRow> training_rows() {
    std::vector<SpeedRow> rows;
    for (const std::string name : {"celeba-64", "celeba-128", "celeba-256"})
        rows.push_back(
            {"train-" + name, "training",
             "stage 1, eight images, LPIPS (SqueezeNet), `" + name + "`",
             [name](const BenchOptions& options) { return training_step(options, name); }, name});
    return rows;
}

Study training_study() {
    return {.part = "training",
            .name = "training",
            .title = "Training",
            .varied = "samples per ray in the first stage, trained for the same time",
            .measured = "reconstruction loss and PSNR with these samples and with 64",
            .reference = "held-out heads",
            .columns = {"samples", "seconds_per_step", "steps", "images", "seconds",
                        "reconstruction_loss", "psnr_db", "psnr_64_db"},
            .plan = training_plan,
            .seconds = 100.0};
}

Study step_study() {
    return {
        .part = "training",
        .name = "training_steps",
        .title = "What a step of training leaves out",
        .varied = "precision of products, samples without a gradient; as many steps for each",
        .measured = "time of a step; PSNR: the median, least and most of three seeds",
        .reference = "held-out heads",
        .columns = {"way", "seconds_per_step", "steps", "psnr_db", "psnr_least_db", "psnr_most_db"},
        .plan = step_plan,
        .seconds = 120.0};
}

}  // namespace stymo
