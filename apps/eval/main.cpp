#include <filesystem>
#include <iostream>
#include <optional>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/common/fit_optimizer.h"
#include "apps/common/lpips_options.h"
#include "apps/common/model_options.h"
#include "apps/common/tools.h"
#include "apps/eval/drawn.h"
#include "apps/eval/evaluate.h"
#include "apps/eval/identity.h"
#include "apps/eval/pair.h"
#include "apps/eval/report_page.h"
#include "apps/eval/run_split.h"
#include "apps/eval/score_sheet.h"
#include "apps/eval/shape.h"
#include "core/io/checksum.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "nn/realtime/view.h"
#include "render/morphable/head_source.h"

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
    std::string optimizer = "adam";
    std::optional<std::int64_t> samples;
    stymo::LpipsOptions lpips;
    stymo::EvaluationOptions evaluation;
    stymo::TuningOptions tuning;

    [[nodiscard]] bool tunes() const { return tuning.seconds > 0.0 || tuning.steps > 0; }
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

stymo::Settings settings_of(const Options& options) {
    const auto absolute = [](const fs::path& path) {
        return path.empty() ? std::string() : fs::absolute(path).string();
    };
    const auto weights = [&](const std::string& file) {
        return file == "random" ? file : absolute(file);
    };
    std::ostringstream checksum;
    checksum << std::hex << stymo::crc32c(stymo::read_text_file(stymo::model_file(options.model)));
    const stymo::FitOptions& fitting = options.evaluation.fitting;
    const auto or_own = [](const auto& value) {
        return value ? stymo::JsonValue(*value) : stymo::JsonValue("the model's own");
    };
    return {{"--model", absolute(stymo::model_file(options.model)) + ", CRC-32C " + checksum.str()},
            {"--data", absolute(options.data)},
            {"--split", options.split},
            {"--ids", options.ids},
            {"--region", options.region},
            {"--parser", absolute(options.parser)},
            {"--identity", absolute(options.identity)},
            {"--shape", options.shape},
            {"--landmarks", absolute(options.landmarks)},
            {"--fit", options.evaluation.fit},
            {"--steps", fitting.steps},
            {"--optimizer", options.optimizer},
            {"--learning-rate", fitting.learning_rate},
            {"--regularizer", fitting.regularizer},
            {"--samples", or_own(options.samples)},
            {"--refine-pose", fitting.refine_pose},
            {"--morphable", absolute(options.morphable)},
            {"--depth-weight", fitting.depth_weight},
            {"--tune", options.tuning.seconds},
            {"--tune-steps", options.tuning.steps},
            {"--tune-depth", options.tuning.depth_weight},
            {"--resolution", options.evaluation.resolution},
            {"--perceptual-network", options.lpips.perceptual_network.empty()
                                         ? stymo::JsonValue("the model's own")
                                         : stymo::JsonValue(options.lpips.perceptual_network)},
            {"--perceptual-weight", or_own(options.lpips.perceptual_weight)},
            {"--perceptual-resolution", or_own(options.lpips.perceptual_resolution)},
            {"--lpips", options.lpips.metric},
            {"--lpips-trunk", weights(options.lpips.trunk)},
            {"--lpips-heads", weights(options.lpips.heads)}};
}

stymo::Dataset faces_of(const Options& options, const stymo::ModelConfig& model) {
    const stymo::Split split = stymo::split_called(options.split);
    stymo::DataConfig data;
    if (split != stymo::Split::all) data = stymo::split_of_run(stymo::model_file(options.model));
    data.cache_megabytes = 0;
    return {options.data, model.decoder.resolution, data, split, stymo::frontal_pose(model.camera)};
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

stymo::AppResult evaluate(Options options) {
    if (options.data.empty()) stymo::fail<stymo::UsageError>("--data is required");
    stymo::EvaluationOptions& evaluated = options.evaluation;
    evaluated.range = stymo::parse_range(options.ids);
    evaluated.regions = stymo::regions_called(options.region);
    evaluated.fitting.optimizer = stymo::fit_optimizer(options.optimizer);
    if (options.samples) evaluated.fitting.samples_per_ray = *options.samples;
    const stymo::Model model = stymo::load_model(options.model);
    // Throws for a side that the model does not render.
    static_cast<void>(model.decoder().ladder().count_up_to(evaluated.resolution));
    const stymo::Dataset faces = faces_of(options, model.config());
    stymo::FaceRegion face_region(options.parser);
    evaluated.face_region = &face_region;
    stymo::ReconstructionConfig config =
        stymo::fitting_config(options.lpips, model.config().reconstruction);
    std::optional<stymo::MorphableHead> head;
    // A folder does not say to which head its codes belong.
    if (options.shape || !options.morphable.empty())
        head = stymo::morphable_head_from(options.morphable);
    evaluated.fitting.head = options.tuning.head = head ? &*head : nullptr;
    if (options.tunes()) {
        evaluated.tuning = options.tuning;
        if (options.samples) evaluated.tuning->samples_per_ray = *options.samples;
        evaluated.another_decoder = [&options] {
            return stymo::load_model(options.model, stymo::ModelParts::decoder);
        };
    }
    if (!evaluated.fit) config.perceptual_weight = 0.0;
    const stymo::ReconstructionLoss loss(config, "--perceptual-weight 0",
                                         model.has_encoder() ? &model.encoder() : nullptr);
    std::optional<stymo::Lpips> own;
    evaluated.lpips =
        metric_network(options.lpips, model.config().reconstruction.perceptual, loss, own);
    std::optional<stymo::IdentityMeasure> identity;
    if (!options.identity.empty()) evaluated.identity = &identity.emplace(options.identity);
    std::optional<stymo::ShapeMeasure> shape;
    if (options.shape) evaluated.shape = &shape.emplace(options.landmarks, *head);
    const std::string network = evaluated.lpips != nullptr ? evaluated.lpips->label() : "";
    stymo::require_comparable(faces, evaluated);

    const auto settings = settings_of(options);
    stymo::JsonValue settings_json = stymo::JsonValue::object();
    for (const auto& [name, value] : settings) settings_json.add(name, value);
    std::optional<stymo::ScoreFolder> folder;
    if (!options.out.empty()) evaluated.folder = &folder.emplace(options.out, settings_json);
    const stymo::Evaluation evaluation = stymo::evaluate(model, loss, faces, evaluated);
    for (const stymo::FailedFace& face : evaluation.failed)
        std::cerr << "skipped " << face.id << ": " << face.reason << std::endl;

    stymo::AppResult result = result_of(evaluation, network);
    if (folder && evaluation.incomplete.empty()) {
        const std::vector<stymo::SheetRow> rows = stymo::sheet_rows(evaluation.scores);
        stymo::write_image(options.out / "sheet.png",
                           stymo::score_sheet(model, loss, faces, evaluated, rows));
        stymo::JsonValue json = result.json;
        json.add("sheet", sheet_json(rows)).add("settings", settings_json);
        stymo::write_text_file(options.out / "report.json", json.text() + "\n",
                               stymo::Survives::nothing);
        stymo::write_text_file(options.out / "report.md",
                               stymo::report_page(evaluation, {settings, network, rows}),
                               stymo::Survives::nothing);
    }
    stymo::JsonValue scores = stymo::JsonValue::object();
    for (const stymo::FaceScore& score : evaluation.scores) scores.add(score.id, to_json(score));
    result.json.add("faces", scores);
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
                "positions in the order of ids, such as 700-799, within the split if one is given "
                "(default: all)");
    line.option("--out", options.out,
                "output folder: scores.jsonl, report.json, report.md, sheet.png, the fitted "
                "codes and the tuned weights. The same command continues an interrupted run");
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
    line.option("--tune", options.tuning.seconds,
                "also tune the decoder to each fitted face for so many seconds on all threads, and "
                "measure the result")
        .range(0, 86400)
        .needs("--fit");
    line.option("--depth-weight", options.evaluation.fitting.depth_weight,
                "weight of the term that draws the depth of a fitted face to that of the head "
                "model to which the folder's codes belong; needs --shape or --morphable")
        .range(0, 1e6);
    line.option("--tune-depth", options.tuning.depth_weight, "the same while tuning").range(0, 1e6);
    line.option("--tune-steps", options.tuning.steps,
                "end tuning after so many steps, which makes the result repeatable")
        .range(0, 1e6)
        .needs("--fit");
    line.option("--steps", options.evaluation.fitting.steps, "fitting steps").range(0, 1e6);
    stymo::declare_fit_optimizer(line, options.optimizer);
    line.option("--learning-rate", options.evaluation.fitting.learning_rate,
                "learning rate of the first fitting step; 0: the model's setting")
        .range(0, 10);
    line.option("--regularizer", options.evaluation.fitting.regularizer,
                "weight of the squared code offsets; negative: the model's setting")
        .range(-1, 1e6);
    line.flag("--refine-pose", options.evaluation.fitting.refine_pose,
              "also optimise the poses while fitting, with a tenth of the learning rate; slower")
        .needs("--fit");
    line.option("--resolution", options.evaluation.resolution,
                "side of the compared images: 64, 128, ... (default: the model's resolution)")
        .range(64, 4096);
    line.option("--samples", options.samples,
                "samples per ray while fitting (default: the model's setting)")
        .range(2, 4096);
    line.flag("--one-by-one", options.evaluation.one_by_one,
              "give all threads to one face after the other; by default each thread works on a "
              "face of its own");
    stymo::declare_lpips_metric(line, options.lpips);
    stymo::declare_lpips_files(line, options.lpips);
    stymo::declare_perceptual_weight(line, options.lpips);

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
    command.option("--ids", drawn.ids, "positions in the order of ids, such as 700-799");
    command.option("--identity", drawn.identity,
                   "weights of MobileFaceNet, written by stymo-weights import (required)");
    command.option("--count", drawn.count, "number of faces to draw").range(2, 100000);
    command.option("--truncation", drawn.truncation, "1: as varied as the photos; 0: the mean")
        .range(0, 10);
    command.option("--sheet", drawn.sheet, "image file for the first 32 drawn faces");
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return evaluate(options); });
}
