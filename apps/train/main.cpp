#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "apps/common/command_line.h"
#include "apps/common/explain.h"
#include "apps/common/face_input.h"
#include "apps/common/ranked_run.h"
#include "apps/common/result_folder.h"
#include "apps/common/table.h"
#include "apps/common/tools.h"
#include "core/error.h"
#include "core/io/file.h"
#include "train/checkpoint.h"
#include "train/head_mask_training.h"
#include "train/plan.h"
#include "train/trainer.h"

namespace {

struct Options {
    std::filesystem::path config;
    std::filesystem::path data;
    std::filesystem::path out;
    std::vector<std::string> set;
    std::string resume;
    std::filesystem::path initial_model;
    double max_minutes = 0.0;
    bool dry_run = false;
    std::string measure = "ends";
    bool print_keys = false;
    bool head_mask = false;
};

stymo::MeasuredPhases measured_phases(const std::string& name) {
    if (name == "none") return stymo::MeasuredPhases::none;
    return name == "all" ? stymo::MeasuredPhases::all : stymo::MeasuredPhases::ends;
}

void require_paths(const Options& options) {
    for (const auto& [name, path] :
         {std::pair{"--config", options.config}, std::pair{"--data", options.data},
          std::pair{"--out", options.out}}) {
        if (path.empty()) stymo::fail<stymo::UsageError>(name, " is required");
    }
}

/// Locks the folder of a run that is to go on, and completes what a crash has left of its
/// checkpoints, before any process reads them.
void claim(const Options& options, std::optional<stymo::FolderLock>& lock) {
    if (options.dry_run || options.resume.empty()) return;
    if (std::filesystem::is_directory(options.out)) lock.emplace(options.out);
    const std::filesystem::path checkpoints = options.out / "checkpoints";
    if (std::filesystem::is_directory(checkpoints)) stymo::repair_checkpoint_folders(checkpoints);
    if (options.resume != "latest") stymo::repair_checkpoint_folder(options.resume);
}

/// Throws what the loss says of LPIPS' files, before the photos are read, which takes long.
stymo::TrainConfig with_perceptual_files(stymo::TrainConfig config) {
    const stymo::ReconstructionConfig& loss = config.model.reconstruction;
    for (const std::string& file : {loss.perceptual.trunk, loss.perceptual.heads})
        if (loss.perceptual_weight > 0.0 && file != "random" &&
            !std::filesystem::is_regular_file(file))
            static_cast<void>(stymo::ReconstructionLoss(loss));
    return config;
}

/// A run before its first step.
struct PreparedRun {
    stymo::TrainConfig config;
    stymo::Dataset training;
    std::optional<stymo::Dataset> validation;
    std::optional<stymo::Trainer> trainer;
    std::string note{};  ///< what has changed since the checkpoint

    PreparedRun(const Options& options, const stymo::CommonOptions& common, stymo::Ranks* ranks)
        : config(with_perceptual_files(stymo::load_train_config(options.config, options.set))),
          training(stymo::faces_for_training(options.data, config, stymo::Split::training)) {
        config.model.camera =
            stymo::with_intrinsics(config.model.camera, training.load(0).intrinsics);
        // A checkpoint or a model contains the backbone's trained weights, so their file need not
        // be given.
        const bool random_start = options.resume.empty() && options.initial_model.empty();
        if (random_start && config.stage1.decoder_frozen)
            stymo::fail<stymo::ConfigError>(
                "stage1.decoder_frozen needs --initial-model: its decoder would stay random");
        if (options.dry_run) {
            // Measures what most steps do, not the cheaper ones at the beginning.
            config.optimizer.backbone_frozen_epochs = 0;
            config.loss.mask_start_epoch = 0;
        }
        if (!random_start) stymo::assume_weights(config.model.encoder);
        if (config.data.validation > 0)
            validation = stymo::faces_for_training(options.data, config, stymo::Split::validation);
        trainer.emplace(config, training, validation ? &*validation : nullptr, common.seed, ranks);
        if (!options.initial_model.empty())
            if (const std::string doubt = trainer->begin_with(options.initial_model);
                !doubt.empty())
                std::cerr << doubt << '\n';
        if (!options.resume.empty() && !options.dry_run)
            note =
                trainer->resume(options.resume == "latest" ? stymo::latest_checkpoint(options.out)
                                                           : std::filesystem::path(options.resume));
        std::cerr << "training: " << training.summary().text() << '\n';
    }
};

stymo::AppResult plan(const Options& options, PreparedRun& run) {
    const stymo::TrainingPlan plan = stymo::measure_plan(*run.trainer, run.config, run.training,
                                                         measured_phases(options.measure));
    return {stymo::plan_text(plan), stymo::to_json(plan)};
}

stymo::AppResult lead(const Options& options, PreparedRun& run,
                      std::optional<stymo::FolderLock>& lock) {
    stymo::require_writable_folder(options.out);
    if (!lock) lock.emplace(options.out);
    const stymo::RunFolder folder(options.out, !options.resume.empty());
    if (folder.replace_config(stymo::to_json(run.config)))
        std::cerr << "the configuration differs from that of the run so far; the run goes on with "
                     "the new one\n";
    if (!run.note.empty()) {
        std::cerr << run.note << '\n';
        folder.log(run.note);
    }
    const std::size_t known = run.training.summary().broken.size();
    const stymo::TrainingOutcome outcome =
        run.trainer->run(folder, {.minutes = options.max_minutes});
    stymo::write_broken_files(std::cerr, run.training.summary(), known);
    stymo::count_for_report("steps", outcome.steps);
    return {stymo::outcome_text(outcome, folder), stymo::to_json(outcome, folder)};
}

/// Trains a head-mask network instead of a model of faces.
stymo::AppResult train_masks(const Options& options, const stymo::CommonOptions& common) {
    require_paths(options);
    if (!options.resume.empty() && options.resume != "latest")
        stymo::fail<stymo::UsageError>("--head-mask goes on with --resume latest alone");
    if (stymo::started_ranks())
        stymo::fail<stymo::UsageError>(
            "--head-mask trains in one process; start it without mpirun");
    const auto config = stymo::HeadMaskTrainingConfig::load(options.config, options.set);
    const stymo::HeadMaskExamples examples(options.data);
    stymo::write_left_out(std::cerr, examples.left_out());
    const stymo::HeadMaskModel model = options.initial_model.empty()
                                           ? stymo::make_head_mask_model(stymo::Rng(common.seed))
                                           : stymo::read_head_mask_model(options.initial_model);
    stymo::require_writable_folder(options.out);
    const stymo::FolderLock lock(options.out);
    const stymo::HeadMaskTrainingOutcome outcome =
        stymo::train_head_mask(model, examples, config,
                               {.folder = options.out,
                                .resume = !options.resume.empty(),
                                .minutes = options.max_minutes,
                                .seed = common.seed});
    const std::string file = (options.out / stymo::head_mask_file).string();
    const std::string loss =
        std::isfinite(outcome.loss) ? stymo::text_from(", loss ", outcome.loss) : std::string();
    return {stymo::text_from(outcome.steps, " of ", config.steps, " steps", loss, ": ", file, '\n'),
            stymo::JsonValue::object({{"steps", outcome.steps},
                                      {"photos", examples.size()},
                                      {"loss", outcome.loss},
                                      {"seconds", outcome.seconds},
                                      {"finished", outcome.finished},
                                      {"network", file}})};
}

/// Throws FileError if the run's images would count as photos, or if a checkpoint of another run
/// would go on in a folder that holds a run.
void require_own_folder(const Options& options) {
    namespace fs = std::filesystem;
    if (options.dry_run) return;
    stymo::ResultFolder::require_apart(options.out, options.data);
    if (options.resume.empty() || options.resume == "latest" ||
        !fs::exists(options.out / "latest") ||
        fs::weakly_canonical(fs::absolute(options.resume)).parent_path() ==
            fs::weakly_canonical(options.out / "checkpoints"))
        return;
    stymo::fail<stymo::FileError>(options.out.string(),
                                  ": holds a training run to which the checkpoint ", options.resume,
                                  " does not belong; choose another --out");
}

stymo::AppResult train(Options options, const stymo::CommonOptions& common) {
    if (options.print_keys)
        return {stymo::configuration_table(),
                stymo::JsonValue::object({{"table", stymo::configuration_table()}})};
    if (options.head_mask) return train_masks(options, common);
    // The name of a checkpoint tells its step (checkpoint_step), but not behind the slash that a
    // shell adds when it completes the name.
    if (const std::filesystem::path resumed = options.resume; !resumed.has_filename())
        options.resume = resumed.parent_path().string();
    require_paths(options);
    require_own_folder(options);
    std::optional<stymo::FolderLock> lock;
    if (const std::unique_ptr<stymo::Ranks> ranks = stymo::started_ranks()) {
        std::optional<PreparedRun> run;
        return stymo::run_as_rank(
            *ranks, "stymo-train",
            {.claim = [&] { claim(options, lock); },
             .prepare =
                 [&] {
                     if (options.dry_run)
                         stymo::fail<stymo::UsageError>(
                             "--dry-run measures one process; start it without mpirun");
                     run.emplace(options, common, &*ranks);
                 },
             .state =
                 [&] {
                     return stymo::common_state(run->config, run->training, run->trainer->state(),
                                                options.initial_model);
                 },
             .lead = [&] { return lead(options, *run, lock); },
             .follow = [&] { static_cast<void>(run->trainer->follow()); }});
    }
    claim(options, lock);
    PreparedRun run(options, common, nullptr);
    return options.dry_run ? plan(options, run) : lead(options, run, lock);
}

}  // namespace

int stymo_train(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-train", "Trains a model on a folder of faces.",
                            stymo::MatmulPrecision::medium);
    line.option("--config", options.config, "JSON configuration (docs/configuration.md)");
    line.option("--data", options.data, "folder of faces in FFHQ format (docs/data.md)");
    line.option("--out", options.out, "run folder");
    line.option("--set", options.set,
                "a.b=value: override one key of the configuration; may be repeated");
    line.option("--resume", options.resume, "'latest' or the folder of a checkpoint");
    line.option("--initial-model", options.initial_model,
                "begin a new run with the weights of this model, not with random ones")
        .excludes("--resume");
    line.option("--max-minutes", options.max_minutes,
                "stop after so many minutes; 0: when all steps are done")
        .range(0.0, 1e6);
    line.flag("--dry-run", options.dry_run,
              "print the plan with measured time and memory of a step, and write nothing");
    line.flag("--head-mask", options.head_mask,
              "train a network that finds the head in photos (configs/models/head-mask)")
        .excludes("--dry-run");
    line.option("--measure", options.measure,
                "phases whose steps the dry run measures: the first and the last, all, or none")
        .one_of({"ends", "all", "none"})
        .needs("--dry-run");
    line.flag("--print-keys", options.print_keys,
              "print the table of all configuration keys and stop");
    return line.run(argc, argv,
                    [&](const stymo::CommonOptions& common) { return train(options, common); });
}
