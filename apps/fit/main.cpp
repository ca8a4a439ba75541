#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <optional>
#include <sstream>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/explain.h"
#include "apps/common/face_input.h"
#include "apps/common/fit_optimizer.h"
#include "apps/common/lpips_options.h"
#include "apps/common/model_options.h"
#include "apps/common/preparation_options.h"
#include "apps/common/prepared_photos.h"
#include "apps/common/tools.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "fit/fit_report.h"
#include "fit/tuning.h"
#include "nn/models/code_file.h"
#include "nn/models/weight_changes.h"
#include "render/morphable/head_source.h"

namespace {

struct Options {
    stymo::ModelOptions model;
    std::filesystem::path out;
    stymo::FaceSource face;
    std::optional<std::int64_t> samples;
    stymo::LpipsOptions lpips;
    stymo::PhotoPreparationSettings preparation;
    stymo::FitOptions fit;
    std::string optimizer = "adam";
    stymo::TuningOptions tuning;
    bool explain = false;
};

void write_metrics(std::ostream& stream, const char* name, const stymo::ImageMetrics& metrics) {
    stream << std::left << std::setw(9) << name << std::right << std::fixed << std::setprecision(4)
           << std::setw(9) << metrics.l1;
    if (metrics.lpips) stream << std::setw(9) << *metrics.lpips;
    stream << std::setw(9) << metrics.ssim << std::setprecision(2) << std::setw(9) << metrics.psnr
           << '\n';
}

std::string summary(const stymo::FitReport& report, double seconds) {
    std::ostringstream text;
    text << "                L1" << (report.lpips_network.empty() ? "" : "    LPIPS")
         << "     SSIM  PSNR dB\n";
    write_metrics(text, "initial", report.initial_metrics);
    write_metrics(text, "fitted", report.fitted_metrics);
    if (report.tuned.defined()) write_metrics(text, "tuned", report.tuned_metrics);
    text << std::setprecision(1) << seconds << " s\n";
    if (!report.lpips_network.empty()) text << "LPIPS: " << report.lpips_network << '\n';
    return text.str();
}

/// The photos to be fitted together, with their output folders.
struct Photo {
    stymo::Face face;
    std::filesystem::path out;
    std::optional<std::vector<std::string>> warnings;  ///< of a photo that was prepared
};

std::filesystem::path tuned_file(const Options& options) {
    return options.out / "tuned.safetensors";
}

/// Prepares the photos and shows the results before the fit, which takes longer.
std::vector<Photo> prepared(const Options& options, const stymo::ModelConfig& model) {
    std::vector<stymo::PreparedPhoto> ready =
        stymo::prepare_photos(options.face.images, model, options.preparation);
    std::vector<Photo> photos;
    for (stymo::PreparedPhoto& photo : ready) {
        const std::filesystem::path out =
            ready.size() == 1 ? options.out : options.out / photo.face.id;
        stymo::require_writable_folder(out);
        stymo::write_image(out / "aligned.png", photo.aligned);
        stymo::write_image(out / "overlay.png", photo.overlay);
        for (const std::string& warning : photo.warnings)
            std::cerr << "warning: " << photo.face.id << ": " << warning << std::endl;
        photos.push_back({std::move(photo.face), out, std::move(photo.warnings)});
    }
    return photos;
}

std::vector<Photo> photos_of(const Options& options, const stymo::ModelConfig& model) {
    if (options.face.as_it_comes()) return prepared(options, model);
    Photo photo{stymo::read_face(options.face, model), options.out, {}};
    stymo::require_writable_folder(options.out);
    return {std::move(photo)};
}

/// Writes what the fit has found before the decoder is tuned, which takes long. Changes of weights
/// that an earlier fit has left belong to other codes.
void write_codes(const Options& options, const std::vector<Photo>& photos,
                 const stymo::FitResult& result) {
    std::error_code ignored;
    std::filesystem::remove(tuned_file(options), ignored);
    for (std::size_t i = 0; i < photos.size(); ++i)
        stymo::write_code_file(photos[i].out / "codes.json", result.fitted,
                               static_cast<std::int64_t>(i),
                               stymo::pose_from_camera(result.cameras[i]));
}

stymo::JsonValue write_fit(const Photo& photo, const stymo::FitReport& report,
                           const stymo::FitResult& result, double seconds) {
    stymo::JsonValue json = to_json(report, result, seconds);
    if (photo.warnings) json.add("warnings", *photo.warnings);
    stymo::write_image(photo.out / "fit.png", stymo::comparison_sheet(report));
    stymo::write_image(photo.out / "render.png",
                       report.tuned.defined() ? report.tuned : report.fitted);
    stymo::write_text_file(photo.out / "report.json", json.text() + "\n", stymo::Survives::nothing);
    return json;
}

[[nodiscard]] bool tunes(const Options& options) {
    return options.tuning.seconds > 0.0 || options.tuning.steps > 0;
}

/// Tunes the decoder to the fitted photos and writes the changes of its weights. Returns nothing if
/// a signal has asked the process to stop.
std::optional<stymo::Model> tune(const Options& options, const stymo::Model& model,
                                 const stymo::ReconstructionLoss& loss,
                                 const stymo::FaceBatch& batch, const stymo::FitResult& fitted,
                                 stymo::Explainer& explainer) {
    if (!tunes(options) || stymo::interrupted()) return std::nullopt;
    stymo::Model tuned = stymo::load_model(options.model, stymo::ModelParts::decoder);
    stymo::TuningOptions tuning = options.tuning;
    if (options.samples) tuning.samples_per_ray = *options.samples;
    tuning.tolerance = options.fit.tolerance;
    // If time is the limit, progress is in thousandths of the time.
    const std::int64_t total = tuning.steps > 0 ? tuning.steps : 1000;
    stymo::Progress progress(
        {.title = "tune", .total = total, .unit = tuning.steps > 0 ? "steps" : "parts"});
    tuning.on_step = [&](const stymo::TuningStep& step) {
        const auto part =
            static_cast<std::int64_t>(1000.0 * step.seconds / std::max(tuning.seconds, 1e-3));
        progress.update(tuning.steps > 0 ? step.steps : std::min(part, total),
                        "loss " + std::to_string(step.loss));
    };
    const stymo::TuningResult done =
        stymo::tune_decoder(model, tuned, loss, batch, fitted.fitted, fitted.cameras, tuning);
    progress.finish();
    explainer.count("tuning_steps", std::ssize(done.losses));
    if (stymo::interrupted()) return std::nullopt;
    const std::filesystem::path file = tuned_file(options);
    stymo::WeightChanges::between(model, tuned).save(file);
    // Read back, because other tools will use the 16-bit weights of the file.
    return stymo::load_model({options.model.file, file}, stymo::ModelParts::decoder);
}

stymo::AppResult fit(Options options) {
    stymo::require_photo(options.face);
    if (options.samples) options.fit.samples_per_ray = *options.samples;
    options.fit.optimizer = stymo::fit_optimizer(options.optimizer);
    stymo::Explainer explainer(options.explain);
    const stymo::Model model = stymo::load_model(options.model);
    const stymo::ReconstructionConfig config =
        stymo::fitting_config(options.lpips, model.config().reconstruction);
    const stymo::ReconstructionLoss reconstruction(
        config, "--perceptual-weight 0", model.has_encoder() ? &model.encoder() : nullptr);
    // Files on the command line are read even if the fit does not use the term.
    std::optional<stymo::Lpips> metric;
    if (reconstruction.lpips() == nullptr && !options.lpips.trunk.empty())
        metric.emplace(stymo::metric_config(options.lpips, config.perceptual),
                       "leave out --lpips-trunk");
    // Only the shipped model is known to represent heads of photos; a user's model may have been
    // trained on anything.
    if (options.model.file.empty()) options.preparation.mask_model = &model;
    const std::vector<Photo> photos = photos_of(options, model.config());
    std::vector<stymo::Face> faces;
    for (const Photo& photo : photos) faces.push_back(photo.face);
    const stymo::FaceBatch batch = stymo::make_batch(faces, model.decoder().ladder().smallest());
    options.fit.one_person = photos.size() > 1;
    // A folder does not say to which head its codes belong.
    std::optional<stymo::MorphableHead> head;
    if (options.face.as_it_comes() || !options.preparation.morphable.empty())
        head = stymo::morphable_head_from(options.preparation.morphable);
    options.fit.head = options.tuning.head = head ? &*head : nullptr;

    const stymo::InterruptGuard guard;
    stymo::Progress progress({.title = "fit", .total = options.fit.steps, .unit = "steps"});
    options.fit.on_step = [&](const stymo::FitStep& step) {
        progress.update(step.steps, "loss " + std::to_string(step.loss));
    };
    const double start = stymo::seconds_now();
    const stymo::FitResult result = stymo::fit_codes(model, reconstruction, batch, options.fit);
    const double seconds = stymo::seconds_now() - start;
    progress.finish();
    write_codes(options, photos, result);
    const std::optional<stymo::Model> tuned =
        tune(options, model, reconstruction, batch, result, explainer);

    const stymo::Lpips* lpips = metric ? &*metric : reconstruction.lpips();
    if (lpips == nullptr)
        std::cerr << "LPIPS is not measured; name its weights with --lpips-trunk and --lpips-heads"
                  << std::endl;
    stymo::AppResult done;
    std::vector<stymo::JsonValue> reports;
    for (std::size_t i = 0; i < photos.size(); ++i) {
        const auto index = static_cast<std::int64_t>(i);
        stymo::FitReport report =
            stymo::report_fit(model, batch, batch.mask, result, index, lpips, true);
        if (tuned) stymo::add_tuned(report, *tuned, batch, batch.mask, result, index, lpips);
        reports.push_back(write_fit(photos[i], report, result, seconds));
        if (photos.size() > 1) done.text += photos[i].face.id + "\n";
        done.text += summary(report, seconds);
    }
    done.json =
        photos.size() == 1 ? reports.front() : stymo::JsonValue::object({{"photos", reports}});
    const std::int64_t steps = std::ssize(result.losses);
    explainer.count("photos", std::ssize(photos));
    explainer.count("steps", steps);
    explainer.finish(done);
    if (steps < options.fit.steps && !result.converged)
        done.incomplete = "interrupted after " + std::to_string(steps) + " of " +
                          std::to_string(options.fit.steps) + " steps";
    else if (tunes(options) && !tuned)
        done.incomplete = "interrupted while tuning; the fit is complete";
    return done;
}

}  // namespace

int stymo_fit(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-fit",
                            "Fits the codes of a model to a photo, or to several photos of one "
                            "person, for rendering the face from any side.");
    stymo::declare_model(line, options.model);
    line.option("--image", options.face.images,
                "photo; its face is found, aligned and masked. Repeat the option to fit photos of "
                "one person together");
    line.option("--mask", options.face.mask,
                "head mask of a photo that is aligned like FFHQ; without --pose the face is "
                "assumed to be frontal");
    line.option(
        "--pose", options.face.pose,
        "JSON file with the pose of an aligned photo; without --mask the whole frame is fitted");
    line.flag("--as-is", options.face.as_is,
              "the photo is aligned like FFHQ and the face is frontal; the whole frame is fitted");
    line.option("--data", options.face.data,
                "folder of faces in the FFHQ format with the photo, its mask and its pose");
    line.option("--id", options.face.id, "id of the photo in --data").needs("--data");
    line.option("--out", options.out,
                "output folder: fit.png, render.png, codes.json, report.json; also aligned.png and "
                "overlay.png if the photo is prepared, and tuned.safetensors with --tune")
        .required();
    stymo::declare_preparation_files(line, options.preparation);
    line.option("--steps", options.fit.steps, "optimiser steps").range(0, 1e6);
    stymo::declare_fit_optimizer(line, options.optimizer);
    line.option("--learning-rate", options.fit.learning_rate,
                "learning rate of the first step; 0: the model's setting")
        .range(0, 10);
    line.option("--decay", options.fit.decay, "Adam's factor on the learning rate after each step")
        .range(0, 1);
    line.option("--coarse-steps", options.fit.coarse_steps,
                "number of initial steps that compare images of 64 pixels, then 128, up to half of "
                "the model's resolution; faster")
        .range(0, 1e6);
    line.option("--regularizer", options.fit.regularizer,
                "weight of the squared code offsets; negative: the model's setting")
        .range(-1, 1e6);
    line.option("--samples", options.samples, "samples per ray (default: the model's setting)")
        .range(2, 4096);
    line.option("--tolerance", options.fit.tolerance,
                "samples with a smaller compositing weight are left out of fit and tuning; all are "
                "evaluated again every 8 steps; 0: no sample is left out")
        .range(0, 1);
    line.flag("--refine-pose", options.fit.refine_pose,
              "also optimise the pose, with a tenth of the learning rate; slower");
    line.option("--tune", options.tuning.seconds,
                "also tune the decoder to the photo for so many seconds; stymo-render and "
                "stymo-edit take the result, OUT/tuned.safetensors, with --tuned")
        .range(0, 86400);
    line.option("--tune-steps", options.tuning.steps,
                "end tuning after so many steps, which makes the result repeatable")
        .range(0, 1e6);
    line.option(
            "--tune-learning-rate", options.tuning.learning_rate,
            "highest learning rate of tuning, that of the render blocks; the field's is a quarter "
            "of it")
        .range(0, 1);
    line.option("--depth-weight", options.fit.depth_weight,
                "weight of the term that draws the depth of the face to that of the linear head "
                "that was fitted to the photo; with --data it needs --morphable")
        .range(0, 1e6);
    line.option("--tune-depth", options.tuning.depth_weight, "the same while tuning").range(0, 1e6);
    line.option("--locality", options.tuning.locality_weight,
                "weight of the term that keeps other faces and other views as they were while "
                "tuning")
        .range(0, 1e6);
    stymo::declare_perceptual_weight(line, options.lpips);
    stymo::declare_lpips_files(line, options.lpips);
    stymo::declare_explain(line, options.explain);
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return fit(options); });
}
