#include <filesystem>
#include <iostream>
#include <optional>

#include "apps/common/command_line.h"
#include "apps/common/evaluate.h"
#include "apps/common/face_input.h"
#include "apps/common/output_file.h"
#include "core/io/image.h"
#include "nn/models/view.h"

namespace {

struct Options {
    std::filesystem::path model;
    std::filesystem::path data;
    std::filesystem::path sheet;
    std::string ids;
    std::optional<std::int64_t> samples;
    stymo::EvaluationOptions evaluation;
};

stymo::AppResult evaluate(Options options) {
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
    const stymo::Evaluation evaluation = stymo::evaluate(model, faces, options.evaluation);
    stymo::write_broken_files(std::cerr, faces.summary(), 0);
    if (evaluation.turning_sheet.defined()) stymo::write_image(options.sheet, evaluation.turning_sheet);
    return {stymo::table(evaluation.scores, options.evaluation.fit), stymo::to_json(evaluation.scores, options.evaluation.fit)};
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-eval",
                            "Scores a model on a folder of faces: L1, SSIM and PSNR of the head on black, over the full frame.");
    line.option("--model", options.model, "model.safetensors of a training run").required();
    line.option("--data", options.data, "folder of faces in FFHQ format").required();
    line.option("--ids", options.ids, "places in the order of ids, such as 700-799; without it all");
    line.flag("--fit", options.evaluation.fit, "also fit each face and score the fitted codes");
    line.option("--steps", options.evaluation.fitting.steps, "fitting steps").range(0, 1e6);
    line.option("--regularizer", options.evaluation.fitting.regularizer,
                "weight of the squared code offsets; negative: the model's own")
        .range(-1, 1e6);
    line.option("--samples", options.samples, "samples per ray while fitting; the model's own unless given").range(2, 4096);
    line.option("--sheet", options.sheet,
                "picture of the first 8 faces: target, fitted, and five views from yaw -30 to 30 degrees");
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return evaluate(options); });
}
