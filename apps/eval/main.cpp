#include <filesystem>
#include <iostream>
#include <optional>

#include "apps/common/command_line.h"
#include "apps/common/evaluate.h"
#include "apps/common/face_input.h"
#include "apps/common/lpips_options.h"
#include "apps/common/output_file.h"
#include "apps/eval/pair.h"
#include "core/io/image.h"
#include "nn/models/view.h"

namespace {

struct Options {
    std::filesystem::path model;
    std::filesystem::path data;
    std::filesystem::path sheet;
    std::string ids;
    std::optional<std::int64_t> samples;
    stymo::LpipsOptions lpips;
    stymo::EvaluationOptions evaluation;
};

/// The network that was asked for: the loss's if it is the same, else one of its own, which `own` keeps. Null if none was.
const stymo::Lpips* metric_network(const stymo::LpipsOptions& options, const stymo::LpipsConfig& model,
                                   const stymo::ReconstructionLoss& loss, std::optional<stymo::Lpips>& own) {
    if (options.metric.empty()) return nullptr;
    const stymo::LpipsConfig config = stymo::metric_config(options, model);
    if (loss.lpips() != nullptr && loss.lpips()->config() == config) return loss.lpips();
    return &own.emplace(config, "leave out --lpips");
}

stymo::AppResult evaluate(Options options) {
    if (options.model.empty()) stymo::fail<stymo::UsageError>("--model is required");
    if (options.data.empty()) stymo::fail<stymo::UsageError>("--data is required");
    options.evaluation.range = stymo::parse_range(options.ids);
    if (options.samples) options.evaluation.fitting.samples_per_ray = *options.samples;
    if (!options.sheet.empty()) {
        stymo::require_extension(options.sheet, {".png", ".jpg"});
        options.evaluation.yaw_rows = 8;
    }
    const stymo::Model model = stymo::Model::load(options.model);
    const stymo::Dataset faces(options.data, model.config().decoder.resolution, {.cache_megabytes = 0}, stymo::Split::all,
                               stymo::frontal_pose(model.config().camera));
    if (!options.sheet.empty()) stymo::require_folder_of(options.sheet);
    stymo::ReconstructionConfig config = stymo::fitting_config(options.lpips, model.config().reconstruction);
    if (!options.evaluation.fit) config.perceptual_weight = 0.0;
    const stymo::ReconstructionLoss loss(config, "--perceptual-weight 0");
    std::optional<stymo::Lpips> own;
    const stymo::Lpips* metric = metric_network(options.lpips, model.config().reconstruction.perceptual, loss, own);
    options.evaluation.lpips = metric;
    const stymo::Evaluation evaluation = stymo::evaluate(model, loss, faces, options.evaluation);
    stymo::write_broken_files(std::cerr, faces.summary(), 0);
    if (evaluation.turning_sheet.defined()) stymo::write_image(options.sheet, evaluation.turning_sheet);
    stymo::AppResult result{stymo::table(evaluation.scores, options.evaluation.fit),
                            stymo::to_json(evaluation.scores, options.evaluation.fit), evaluation.incomplete};
    if (metric != nullptr) {
        result.text += "LPIPS: " + metric->label() + "\n";
        result.json.add("lpips_network", metric->label());
    }
    return result;
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    stymo::CommandLine line(
        "stymo-eval", "Scores a model on a folder of faces: L1, LPIPS, SSIM and PSNR of the head on black, over the full frame.");
    line.option("--model", options.model, "model.safetensors of a training run (required)");
    line.option("--data", options.data, "folder of faces in FFHQ format (required)");
    line.option("--ids", options.ids, "places in the order of ids, such as 700-799; without it all");
    line.flag("--fit", options.evaluation.fit, "also fit each face and score the fitted codes");
    line.option("--steps", options.evaluation.fitting.steps, "fitting steps").range(0, 1e6);
    line.option("--regularizer", options.evaluation.fitting.regularizer,
                "weight of the squared code offsets; negative: the model's own")
        .range(-1, 1e6);
    line.option("--resolution", options.evaluation.resolution,
                "side of the pictures that are compared: 64, 128, ...; the model's own unless given")
        .range(64, 4096);
    line.option("--samples", options.samples, "samples per ray while fitting; the model's own unless given").range(2, 4096);
    line.option("--sheet", options.sheet,
                "picture of the first 8 faces: target, fitted, and five views from yaw -30 to 30 degrees");
    stymo::declare_lpips_metric(line, options.lpips);
    stymo::declare_lpips_files(line, options.lpips);
    stymo::declare_perceptual_weight(line, options.lpips);

    stymo::PairOptions pair;
    stymo::Command command = line.command("pair", "Compares two pictures of one size as they are.",
                                          [&](const stymo::CommonOptions&) { return stymo::compare_pair(pair); });
    command.option("A", pair.a, "the one picture").required();
    command.option("B", pair.b, "the other picture").required();
    stymo::declare_lpips_metric(command, pair.lpips);
    stymo::declare_lpips_files(command, pair.lpips);
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return evaluate(options); });
}
