#include <filesystem>
#include <iomanip>
#include <iostream>
#include <optional>
#include <sstream>

#include "apps/common/command_line.h"
#include "apps/common/face_input.h"
#include "apps/common/lpips_options.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "fit/fit_report.h"
#include "nn/models/code_file.h"

namespace {

struct Options {
    std::filesystem::path model;
    std::filesystem::path out;
    stymo::FaceSource face;
    std::optional<std::int64_t> samples;
    stymo::LpipsOptions lpips;
    stymo::FitOptions fit;
};

void write_metrics(std::ostream& stream, const char* name, const stymo::ImageMetrics& metrics) {
    stream << std::left << std::setw(9) << name << std::right << std::fixed << std::setprecision(4) << std::setw(9) << metrics.l1;
    if (metrics.lpips) stream << std::setw(9) << *metrics.lpips;
    stream << std::setw(9) << metrics.ssim << std::setprecision(2) << std::setw(9) << metrics.psnr << '\n';
}

std::string summary(const stymo::FitReport& report, double seconds) {
    std::ostringstream text;
    text << "                L1" << (report.lpips_network.empty() ? "" : "    LPIPS") << "     SSIM  PSNR dB\n";
    write_metrics(text, "initial", report.initial_metrics);
    write_metrics(text, "fitted", report.fitted_metrics);
    text << std::setprecision(1) << seconds << " s\n";
    if (!report.lpips_network.empty()) text << "LPIPS: " << report.lpips_network << '\n';
    return text.str();
}

stymo::AppResult fit(Options options) {
    stymo::require_photo(options.face);
    if (options.samples) options.fit.samples_per_ray = *options.samples;
    const stymo::Model model = stymo::Model::load(options.model);
    const stymo::ReconstructionConfig config = stymo::fitting_config(options.lpips, model.config().reconstruction);
    const stymo::ReconstructionLoss reconstruction(config, "--perceptual-weight 0");
    // Files that are named are read, even where fitting does without the term.
    std::optional<stymo::Lpips> metric;
    if (reconstruction.lpips() == nullptr && !options.lpips.trunk.empty())
        metric.emplace(config.perceptual, "leave out --lpips-trunk");
    const stymo::Face face = stymo::read_face(options.face, model.config());
    const stymo::TrainingBatch batch = stymo::make_batch(std::vector{face});
    const stymo::FitTarget target{batch.input, batch.targets, batch.cameras};
    stymo::require_writable_folder(options.out);

    const stymo::InterruptGuard guard;
    stymo::Progress progress({.title = "fit", .total = options.fit.steps, .unit = "steps"});
    options.fit.on_step = [&](std::int64_t step, double loss) { progress.update(step, "loss " + std::to_string(loss)); };
    const double start = stymo::seconds_now();
    const stymo::FitResult result = stymo::fit_codes(model, reconstruction, target, options.fit);
    const double seconds = stymo::seconds_now() - start;
    progress.finish();

    const stymo::Lpips* lpips = metric ? &*metric : reconstruction.lpips();
    if (lpips == nullptr)
        std::cerr << "LPIPS is not measured; name its weights with --lpips-trunk and --lpips-heads" << std::endl;
    const stymo::FitReport report = stymo::report_fit(model, target, batch.mask, result, 0, lpips);
    const stymo::JsonValue json = to_json(report, result, seconds);
    stymo::write_image(options.out / "fit.png", stymo::comparison_sheet(report));
    stymo::write_image(options.out / "render.png", report.fitted);
    stymo::write_code_file(options.out / "codes.json", result.fitted, 0, face.pose);
    stymo::write_text_file(options.out / "report.json", json.text() + "\n");
    stymo::AppResult done{summary(report, seconds), json};
    const std::int64_t steps = std::ssize(result.losses);
    if (steps < options.fit.steps)
        done.incomplete = "interrupted after " + std::to_string(steps) + " of " + std::to_string(options.fit.steps) + " steps";
    return done;
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-fit", "Fits a model to one photo: codes that reproduce it, for rendering from any side.");
    line.option("--model", options.model, "model.safetensors of a training run").required();
    line.option("--image", options.face.image, "the photo, aligned as FFHQ");
    line.option("--mask", options.face.mask, "head mask of the photo; without one the whole frame is fitted");
    line.option("--pose", options.face.pose, "JSON file with the photo's pose; without one the face is taken as frontal");
    line.option("--data", options.face.data, "folder of faces in FFHQ format that has the photo's mask and pose");
    line.option("--id", options.face.id, "the photo's id in --data").needs("--data");
    line.option("--out", options.out, "folder for fit.png, render.png, codes.json, report.json").required();
    line.option("--steps", options.fit.steps, "optimiser steps").range(0, 1e6);
    line.option("--learning-rate", options.fit.learning_rate, "of the first step").range(0, 10);
    line.option("--decay", options.fit.decay, "factor on the learning rate after each step").range(0, 1);
    line.option("--regularizer", options.fit.regularizer, "weight of the squared code offsets; negative: the model's own")
        .range(-1, 1e6);
    line.option("--samples", options.samples, "samples per ray; the model's own unless given").range(2, 4096);
    line.option("--tolerance", options.fit.tolerance,
                "leaves out samples with less compositing weight, examined every 8 steps; 0: none")
        .range(0, 1);
    stymo::declare_perceptual_weight(line, options.lpips);
    stymo::declare_lpips_files(line, options.lpips);
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return fit(options); });
}
