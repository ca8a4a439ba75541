#include <filesystem>

#include "apps/common/command_line.h"
#include "apps/eval/evaluate.h"
#include "core/io/image.h"

namespace {

struct Options {
    std::filesystem::path model;
    std::filesystem::path data;
    std::filesystem::path sheet;
    std::string ids;
    stymo::EvaluationOptions evaluation;
};

stymo::AppResult evaluate(Options options) {
    const stymo::Model model = stymo::Model::load(options.model);
    options.evaluation.range = stymo::parse_range(options.ids);
    if (!options.sheet.empty()) options.evaluation.yaw_rows = 8;
    const stymo::Dataset faces(options.data, model.config().decoder.resolution, {.cache_megabytes = 0}, stymo::Split::all);
    const stymo::Evaluation evaluation = stymo::evaluate(model, faces, options.evaluation);
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
                "weight of the squared code offsets; negative: the model's own");
    line.option("--samples", options.evaluation.fitting.samples_per_ray, "samples per ray while fitting; 0: the model's own")
        .range(0, 4096);
    line.option("--sheet", options.sheet,
                "picture of the first 8 faces: target, fitted, and five views from yaw -30 to 30 degrees");
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return evaluate(options); });
}
