#include <algorithm>
#include <filesystem>
#include <iostream>
#include <optional>
#include <sstream>

#include "apps/common/begun_settings.h"
#include "apps/common/command_line.h"
#include "apps/common/explain.h"
#include "apps/common/face_input.h"
#include "apps/common/fit_options.h"
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
#include "nn/realtime/view.h"

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
    bool explain = false;
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

stymo::Dataset faces_of(const Options& options, const stymo::ModelConfig& model) {
    const stymo::Split split = stymo::split_called(options.split);
    stymo::DataConfig data;
    if (split != stymo::Split::all) data = stymo::split_of_run(stymo::model_file(options.model));
    data.cache_megabytes = 0;
    return {options.data, model.decoder.resolution, data, split, model.camera};
}

stymo::JsonValue sheet_json(const std::vector<stymo::SheetRow>& rows) {
    std::vector<stymo::JsonValue> values;
    for (const stymo::SheetRow& row : rows)
        values.push_back(
            stymo::JsonValue::object({{"id", row.id}, {"kind", row.kind}, {"psnr", row.psnr}}));
    return values;
}

stymo::AppResult result_of(const stymo::Evaluation& evaluation, const std::string& network) {
    stymo::AppResult result{stymo::table(evaluation.scores),
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
        return score.regions.front().last().psnr > stymo::most_plausible_psnr;
    };
    const auto first = std::ranges::find_if(evaluation.scores, doubtful);
    if (first == evaluation.scores.end()) return;
    std::cerr << "warning: " << std::ranges::count_if(evaluation.scores, doubtful)
              << " faces (first: " << first->id << ") have a PSNR of more than "
              << stymo::most_plausible_psnr << " dB" << stymo::implausible_psnr << std::endl;
}

stymo::AppResult evaluate(Options options, const stymo::CommandLine& line) {
    if (options.data.empty()) stymo::fail<stymo::UsageError>("--data is required");
    stymo::EvaluationOptions& evaluated = options.evaluation;
    evaluated.range = stymo::parse_range(options.ids);
    evaluated.regions = stymo::regions_called(options.region);
    stymo::FitJobOptions fitting = options.fit.job_options();
    if (!evaluated.fit && (fitting.tunes() || fitting.fit.refine_pose))
        stymo::fail<stymo::UsageError>("--tune, --tune-steps and --refine-pose require --fit");
    stymo::Explainer explainer(options.explain);
    const stymo::Model model = stymo::load_model(options.model);
    // Throws for a side that the model does not render.
    static_cast<void>(model.decoder().ladder().count_up_to(evaluated.resolution));
    const stymo::Dataset faces = faces_of(options, model.config());
    stymo::write_left_out(std::cerr, faces.summary().left_out);
    stymo::FaceRegion face_region(options.parser);
    evaluated.face_region = &face_region;
    stymo::ReconstructionConfig config =
        stymo::fitting_config(options.lpips, model.config().reconstruction);
    // A folder does not say to which head its codes belong.
    if (options.shape || !options.morphable.empty()) fitting.head = options.morphable;
    if (!evaluated.fit) config.perceptual_weight = 0.0;
    const stymo::ReconstructionLoss loss(config, "--perceptual-weight 0",
                                         model.has_encoder() ? &model.encoder() : nullptr);
    const stymo::FitJob job(model, loss, std::move(fitting));
    std::optional<stymo::Lpips> own;
    evaluated.lpips =
        metric_network(options.lpips, model.config().reconstruction.perceptual, loss, own);
    std::optional<stymo::IdentityMeasure> identity;
    if (!options.identity.empty()) evaluated.identity = &identity.emplace(options.identity);
    std::optional<stymo::ShapeMeasure> shape;
    if (options.shape) evaluated.shape = &shape.emplace(options.landmarks, *job.head());
    const std::string network = evaluated.lpips != nullptr ? evaluated.lpips->label() : "";
    stymo::require_comparable(faces, evaluated);

    const stymo::Settings settings = settings_of(line, options);
    stymo::JsonValue settings_json = stymo::JsonValue::object();
    for (const auto& [name, value] : settings) settings_json.add(name, value);
    std::optional<stymo::ScoreFolder> folder;
    if (!options.out.empty()) evaluated.folder = &folder.emplace(options.out, settings_json);
    const stymo::Evaluation evaluation = stymo::evaluate(job, faces, evaluated);
    for (const stymo::FailedFace& face : evaluation.failed)
        std::cerr << "skipped " << face.id << ": " << face.reason << std::endl;

    write_doubts(evaluation, faces.summary());
    stymo::AppResult result = result_of(evaluation, network);
    if (folder && evaluation.incomplete.empty()) {
        const std::vector<stymo::SheetRow> rows = stymo::sheet_rows(evaluation.scores);
        stymo::write_image(options.out / "sheet.png",
                           stymo::score_sheet(job, faces, evaluated, rows));
        stymo::JsonValue json = result.json;
        json.add("sheet", sheet_json(rows)).add("settings", settings_json);
        stymo::write_file(options.out / "report.json", json.text() + "\n", stymo::Durability::none);
        stymo::write_file(options.out / "report.md",
                          stymo::report_page(evaluation, {settings, network, rows}),
                          stymo::Durability::none);
    }
    stymo::JsonValue scores = stymo::JsonValue::object();
    for (const stymo::FaceScore& score : evaluation.scores) scores.add(score.id, to_json(score));
    result.json.add("faces", scores);
    explainer.count("faces_scored", std::ssize(evaluation.scores));
    explainer.finish(result);
    return result;
}

}  // namespace

int stymo_eval(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-eval",
                            "Measures L1, LPIPS, SSIM and PSNR of a model on a folder of faces, of "
                            "the head on black over the full frame.");
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
    line.option("--morphable", options.morphable,
                "head model that the folder's codes belong to: a .safetensors file or a folder of "
                "ICT-FaceKit (default with --shape: the built-in head)");
    line.flag("--fit", options.evaluation.fit, "also fit each face and measure the fitted codes");
    stymo::declare_fit(line, options.fit);
    line.option("--resolution", options.evaluation.resolution,
                "side of the compared images: 64, 128, ... (default: the model's resolution)")
        .range(64, 4096);
    line.flag("--one-by-one", options.evaluation.one_by_one,
              "give all threads to one face after the other; by default each thread works on a "
              "face of its own")
        .keeps_results();
    stymo::declare_lpips_metric(line, options.lpips);
    stymo::declare_lpips_files(line, options.lpips);
    stymo::declare_perceptual_weight(line, options.lpips);
    stymo::declare_explain(line, options.explain);

    stymo::PairOptions pair;
    stymo::Command command =
        line.command("pair", "Compares two images of the same size, without a mask.",
                     [&](const stymo::CommonOptions&) { return stymo::compare_pair(pair); });
    command.option("A", pair.a, "first image").required();
    command.option("B", pair.b, "second image").required();
    stymo::declare_lpips_metric(command, pair.lpips);
    stymo::declare_lpips_files(command, pair.lpips);

    stymo::DrawnOptions drawn;
    command = line.command(
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

    stymo::PeopleOptions people;
    command = line.command("people", "Measures whether the codes of photos tell who they show.",
                           [&](const stymo::CommonOptions&) { return evaluate_people(people); });
    stymo::declare_model(command, people.model);
    command.option("--data", people.data,
                   "folder of faces whose faces.jsonl names people (required)");
    command.option("--ids", people.ids,
                   "positions in the order of ids, such as 700-799, or a file with one id in each "
                   "line");
    return line.run(argc, argv,
                    [&](const stymo::CommonOptions&) { return evaluate(options, line); });
}
