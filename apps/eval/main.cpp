#include <algorithm>
#include <filesystem>
#include <iostream>
#include <optional>

#include "apps/common/command_line.h"
#include "apps/common/explain.h"
#include "apps/common/face_input.h"
#include "apps/common/fit_options.h"
#include "apps/common/ranked_run.h"
#include "apps/common/result_folder.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "apps/eval/commands.h"
#include "apps/eval/evaluate.h"
#include "apps/eval/person_measures.h"
#include "apps/eval/report_page.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "core/metrics.h"

namespace {

namespace fs = std::filesystem;

struct Options {
    stymo::ModelOptions model;
    fs::path data;
    fs::path out;
    std::string split;
    std::string ids;
    std::string region = "head";
    fs::path parser;
    fs::path identity;
    bool shape = false;
    fs::path landmarks;
    fs::path morphable;
    stymo::FitToolOptions fit;
    stymo::LpipsOptions lpips;
    stymo::EvaluationOptions evaluation;
};

/// The network of the metric: that of the loss if it is the same, else a separate one that `own`
/// holds. Null without a metric.
const stymo::Lpips* metric_network(const stymo::LpipsOptions& options,
                                   const stymo::LpipsConfig& model,
                                   const stymo::ReconstructionLoss& loss,
                                   std::optional<stymo::Lpips>& own) {
    if (options.metric.empty()) return nullptr;
    const stymo::LpipsConfig config = stymo::metric_config(options, model);
    if (loss.lpips() != nullptr && loss.lpips()->config() == config) return loss.lpips();
    return &own.emplace(config, "leave out --lpips");
}

/// What the scores depend on. The model's file is also named by its checksum, because training
/// writes it anew; so is a list of ids.
stymo::Settings settings_of(const stymo::CommandLine& line, const Options& options) {
    stymo::Settings settings = line.settings();
    for (auto& [name, value] : settings) {
        if (name == "--model") value = stymo::with_checksum(stymo::model_file(options.model));
        if (name == "--ids" && !options.evaluation.range.list.empty())
            value = stymo::with_checksum(options.evaluation.range.list);
    }
    return settings;
}

stymo::Dataset faces_of(const Options& options, const stymo::Model& model) {
    // Throws for a side that the model does not render.
    static_cast<void>(model.decoder().ladder().count_up_to(options.evaluation.resolution));
    const stymo::Split split = stymo::split_called(options.split);
    stymo::DataConfig data;
    if (split != stymo::Split::all) data = stymo::split_of_run(stymo::model_file(options.model));
    data.cache_megabytes = 0;
    const stymo::ModelConfig& config = model.config();
    return {options.data, config.decoder.resolution, data, split, config.camera};
}

stymo::JsonValue sheet_json(const std::vector<stymo::SheetRow>& rows) {
    std::vector<stymo::JsonValue> values;
    for (const stymo::SheetRow& row : rows)
        values.push_back(
            stymo::JsonValue::object({{"id", row.id}, {"kind", row.kind}, {"psnr", row.psnr}}));
    return values;
}

stymo::AppResult result_of(const stymo::Evaluation& evaluation, const std::string& network) {
    stymo::AppResult result{stymo::summary_text(evaluation.scores),
                            stymo::summary_json(evaluation.scores, evaluation.failed),
                            evaluation.incomplete};
    if (network.empty()) return result;
    result.text += "LPIPS: " + network + "\n";
    result.json.add("lpips_network", network);
    return result;
}

void write_doubts(const stymo::Evaluation& evaluation, const stymo::DatasetSummary& faces) {
    if (faces.scaled_masks > 0)
        std::cerr << "warning: " << faces.scaled_masks << " faces have a mask of "
                  << stymo::scaled_mask_note << std::endl;
    const auto doubtful = [](const stymo::FaceScore& score) {
        return std::ranges::any_of(score.regions, [](const stymo::RegionScore& region) {
            return region.last().psnr > stymo::most_plausible_psnr;
        });
    };
    const auto first = std::ranges::find_if(evaluation.scores, doubtful);
    if (first == evaluation.scores.end()) return;
    std::cerr << "warning: " << std::ranges::count_if(evaluation.scores, doubtful)
              << " faces (first: " << first->id << ") have a PSNR of more than "
              << stymo::most_plausible_psnr << " dB" << stymo::implausible_psnr << std::endl;
}

/// Everything that scoring needs.
class EvaluationRun {
public:
    EvaluationRun(const Options& options, const stymo::CommandLine& line, stymo::Ranks& ranks)
        : options_(options),
          settings_(settings_of(line, options)),
          model_(stymo::load_model(options.model)),
          // Networks come before the faces, whose scan may take long.
          loss_(loss_config(), "--perceptual-weight 0",
                model_.has_encoder() ? &model_.encoder() : nullptr),
          lpips_(metric_network(options.lpips, model_.config().reconstruction.perceptual, loss_,
                                own_lpips_)),
          region_(options.parser),
          job_(model_, loss_, job_options()),
          faces_(faces_of(options, model_)) {
        stymo::write_left_out(std::cerr, faces_.summary().left_out);
        stymo::EvaluationOptions& evaluated = options_.evaluation;
        evaluated.face_region = &region_;
        evaluated.lpips = lpips_;
        evaluated.ranks = &ranks;
        if (!options.identity.empty()) evaluated.identity = &identity_.emplace(options.identity);
        if (options.shape) evaluated.shape = &shape_.emplace(options.landmarks, *job_.head());
        stymo::require_not_read(options.out, {options.data});
        if (!options.out.empty())
            evaluated.folder =
                &folder_.emplace(options.out, settings_, stymo::model_mark(options.model), ranks);
        stymo::require_comparable(faces_, evaluated);
    }

    /// What must be the same on all ranks.
    [[nodiscard]] stymo::CommonState state() const {
        if (options_.evaluation.folder == nullptr)
            return stymo::common_state(stymo::to_json(settings_), faces_.ids());
        return options_.evaluation.folder->results().state(faces_.ids());
    }
    [[nodiscard]] stymo::Evaluation evaluate() const {
        return stymo::evaluate(job_, faces_, options_.evaluation);
    }
    /// Scores the faces and reports them.
    [[nodiscard]] stymo::AppResult lead() const;

private:
    [[nodiscard]] stymo::ReconstructionConfig loss_config() const {
        stymo::ReconstructionConfig config =
            stymo::fitting_config(options_.lpips, model_.config().reconstruction);
        if (!options_.evaluation.fit) config.perceptual_weight = 0.0;
        return config;
    }
    [[nodiscard]] stymo::FitJobOptions job_options() const {
        stymo::FitJobOptions job = options_.fit.job_options();
        // A folder does not say to which head its codes belong.
        if (options_.shape || !options_.morphable.empty()) job.head = options_.morphable;
        return job;
    }

    Options options_;
    stymo::Settings settings_;
    stymo::Model model_;
    stymo::ReconstructionLoss loss_;
    std::optional<stymo::Lpips> own_lpips_;
    const stymo::Lpips* lpips_;
    stymo::FaceRegion region_;
    stymo::FitJob job_;
    stymo::Dataset faces_;
    std::optional<stymo::IdentityMeasure> identity_;
    std::optional<stymo::ShapeMeasure> shape_;
    std::optional<stymo::ScoreFolder> folder_;
};

stymo::AppResult EvaluationRun::lead() const {
    const stymo::Evaluation evaluation = evaluate();
    for (const stymo::FailedFace& face : evaluation.failed)
        std::cerr << "skipped " << face.id << ": " << face.reason << std::endl;

    write_doubts(evaluation, faces_.summary());
    const std::string network = lpips_ != nullptr ? lpips_->label() : "";
    stymo::AppResult result = result_of(evaluation, network);
    if (options_.evaluation.folder != nullptr && evaluation.incomplete.empty()) {
        const std::vector<stymo::SheetRow> rows = stymo::sheet_rows(evaluation.scores);
        stymo::write_image(options_.out / "sheet.png",
                           stymo::score_sheet(job_, faces_, options_.evaluation, rows));
        stymo::JsonValue json = result.json;
        json.add("sheet", sheet_json(rows))
            .add("settings", options_.evaluation.folder->results().settings());
        stymo::write_file(options_.out / "report.json", json.text() + "\n",
                          stymo::Durability::none);
        stymo::write_file(options_.out / "report.md",
                          stymo::report_page(evaluation, {settings_, network, rows}),
                          stymo::Durability::none);
    }
    stymo::JsonValue scores = stymo::JsonValue::object();
    for (const stymo::FaceScore& score : evaluation.scores) scores.add(score.id, to_json(score));
    result.json.add("faces", scores);
    stymo::count_for_report("faces_scored", std::ssize(evaluation.scores));
    return result;
}

stymo::AppResult evaluate(Options options, const stymo::CommandLine& line) {
    if (options.data.empty()) stymo::fail<stymo::UsageError>("--data is required");
    options.evaluation.range = stymo::parse_range(options.ids);
    options.evaluation.regions = stymo::regions_called(options.region);
    if (!options.parser.empty() && options.region == "head")
        stymo::fail<stymo::UsageError>("--parser requires --region face or both");
    if (!options.morphable.empty() && !options.shape && !options.evaluation.fit)
        stymo::fail<stymo::UsageError>("--morphable requires --shape or --fit");
    if (!(options.lpips.trunk.empty() && options.lpips.heads.empty()) &&
        options.lpips.metric.empty() && !options.evaluation.fit)
        stymo::fail<stymo::UsageError>("--lpips-trunk and --lpips-heads require --lpips or --fit");
    if (!options.out.empty()) stymo::ResultFolder::require_apart(options.out, options.data);
    std::optional<EvaluationRun> run;
    return stymo::run_on_ranks("stymo-eval", [&](stymo::Ranks& ranks) {
        return stymo::RankedRun{.prepare = [&] { run.emplace(options, line, ranks); },
                                .state = [&] { return run->state(); },
                                .lead = [&] { return run->lead(); },
                                .follow = [&] { static_cast<void>(run->evaluate()); }};
    });
}

void declare_evaluation(stymo::CommandLine& line, Options& options) {
    stymo::declare_model(line, options.model);
    line.option("--data", options.data,
                "folder of faces in the FFHQ format or in CelebAMask-HQ's layout (required)");
    line.option("--split", options.split,
                "only this part of the split of the model's training run (config.json)")
        .one_of({"train", "val", "test"});
    line.option("--ids", options.ids,
                "positions in the order of ids, such as 700-799, within the split if one is given; "
                "or a file with one id in each line (default: all)");
    line.option("--out", options.out,
                "output folder: scores.jsonl, report.json, report.md, sheet.png, the fitted "
                "codes and the tuned weights. The same command continues an interrupted run")
        .keeps_results();
    line.option("--region", options.region,
                "compared region: the head, the face without hair and ears, or both")
        .one_of({"head", "face", "both"});
    line.option("--parser", options.parser,
                "face parser in an ONNX file, for faces without a parsing map in the folder")
        .needs("--region");
    line.option("--identity", options.identity,
                "weights of MobileFaceNet, written by stymo-weights import: also measure whether "
                "the face is the person of the photo, from the front and turned");
    line.flag("--shape", options.shape,
              "also measure, with dlib's landmarks, where they are as the face turns, and the "
              "face's depth");
    line.option("--landmarks", options.landmarks,
                "dlib's shape_predictor of 68 landmarks (default: the one of Debian's "
                "libdlib-data)")
        .needs("--shape");
    stymo::declare_head(line, options.morphable, "that the folder's codes belong to",
                        "default with --shape: the built-in head");
    line.flag("--fit", options.evaluation.fit, "also fit each face and measure the fitted codes");
    line.requiring("--fit", [&] { stymo::declare_fit(line, options.fit); });
    line.option("--resolution", options.evaluation.resolution,
                "side of the compared images: 64, 128, ... (default: the model's resolution)")
        .range(64, 4096);
    line.flag("--one-by-one", options.evaluation.one_by_one,
              "give all threads to one face after the other; by default each thread works on a "
              "face of its own")
        .keeps_results();
    stymo::declare_lpips_metric(line, options.lpips);
    stymo::declare_lpips_files(line, options.lpips);
    line.requiring("--fit", [&] { stymo::declare_perceptual_weight(line, options.lpips); });
}

void declare_pair(stymo::CommandLine& line, stymo::PairOptions& pair) {
    stymo::Command command =
        line.command("pair", "Compares two images of the same size, without a mask.",
                     [&](const stymo::CommonOptions&) { return stymo::compare_pair(pair); });
    command.option("A", pair.a, "first image").required();
    command.option("B", pair.b, "second image").required();
    stymo::declare_lpips_metric(command, pair.lpips);
    command.requiring("--lpips", [&] { stymo::declare_lpips_files(command, pair.lpips); });
}

void declare_drawn(stymo::CommandLine& line, stymo::DrawnOptions& drawn) {
    stymo::Command command = line.command(
        "drawn", "Compares faces that are drawn from the model with photos, as a whole.",
        [&](const stymo::CommonOptions& common) { return evaluate_drawn(drawn, common.seed); });
    stymo::declare_model(command, drawn.model);
    command.option("--data", drawn.data, "folder of faces in the FFHQ format (required)");
    command.option("--ids", drawn.ids,
                   "positions in the order of ids, such as 700-799, or a file with one id in each "
                   "line");
    command.option("--identity", drawn.identity,
                   "weights of MobileFaceNet, written by stymo-weights import (required)");
    command.option("--count", drawn.count, "number of faces to draw").range(2, 100000);
    command.option("--truncation", drawn.truncation, "1: as varied as the photos; 0: the mean")
        .range(0, 10);
    command.option("--sheet", drawn.sheet, "image file for the first 32 drawn faces");
}

void declare_people(stymo::CommandLine& line, stymo::PeopleOptions& people) {
    stymo::Command command =
        line.command("people", "Measures whether the codes of photos tell who they show.",
                     [&](const stymo::CommonOptions&) { return evaluate_people(people); });
    stymo::declare_model(command, people.model);
    command.option("--data", people.data,
                   "folder of faces whose faces.jsonl names people (required)");
    command.option("--ids", people.ids,
                   "positions in the order of ids, such as 700-799, or a file with one id in each "
                   "line");
}

}  // namespace

int stymo_eval(int argc, char** argv) {
    Options options;
    stymo::PairOptions pair;
    stymo::DrawnOptions drawn;
    stymo::PeopleOptions people;
    stymo::CommandLine line("stymo-eval",
                            "Measures L1, LPIPS, SSIM and PSNR of a model on a folder of faces, of "
                            "the head on black over the full frame.");
    declare_evaluation(line, options);
    declare_pair(line, pair);
    declare_drawn(line, drawn);
    declare_people(line, people);
    return line.run(argc, argv,
                    [&](const stymo::CommonOptions&) { return evaluate(options, line); });
}
