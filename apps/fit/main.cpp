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
#include "apps/common/fit_options.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/metrics.h"
#include "core/progress.h"
#include "fit/fit_job.h"
#include "nn/models/code_file.h"

namespace {

struct Options {
    stymo::ModelOptions model;
    std::filesystem::path out;
    stymo::FaceSource face;
    stymo::LpipsOptions lpips;
    stymo::FitToolOptions fit;
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

/// The output folder of each photo.
class Output {
public:
    explicit Output(std::filesystem::path folder) : folder_(std::move(folder)) {}

    /// Names the folders of the photos and makes them. Several photos get a folder each.
    void begin(const std::vector<stymo::Face>& faces) {
        for (const stymo::Face& face : faces) {
            folders_.push_back(faces.size() == 1 ? folder_ : folder_ / face.id);
            stymo::require_writable_folder(folders_.back());
        }
    }
    [[nodiscard]] const std::filesystem::path& of(std::size_t photo) const {
        return folders_.at(photo);
    }
    [[nodiscard]] std::filesystem::path tuned_file() const { return folder_ / "tuned.safetensors"; }
    /// Writes what the fit has found before the decoder is tuned, which takes long. Changes of
    /// weights that an earlier fit has left belong to other codes.
    void write_codes(const stymo::FitResult& result) const {
        std::error_code ignored;
        std::filesystem::remove(tuned_file(), ignored);
        for (std::size_t i = 0; i < folders_.size(); ++i)
            stymo::write_code_file(of(i) / "codes.json", result.fitted,
                                   static_cast<std::int64_t>(i),
                                   stymo::pose_from_camera(result.cameras[i]));
    }
    void write_report(std::size_t photo, const stymo::FitReport& report,
                      const stymo::JsonValue& json) const {
        stymo::write_image(of(photo) / "fit.png", stymo::comparison_sheet(report));
        stymo::write_image(of(photo) / "render.png",
                           report.tuned.defined() ? report.tuned : report.fitted);
        stymo::write_file(of(photo) / "report.json", json.text() + "\n", stymo::Durability::none);
    }

private:
    std::filesystem::path folder_;
    std::vector<std::filesystem::path> folders_;
};

/// The photos' faces, and the warnings of those that were prepared.
struct Faces {
    std::vector<stymo::Face> faces;
    std::vector<std::vector<std::string>> warnings;
};

/// Prepares the photos and shows the results before the fit, which takes longer.
Faces prepared(const stymo::FitJob& job, const stymo::FaceSource& source, Output& output) {
    stymo::warn_without_landmark_network(job.options().preparation);
    std::vector<stymo::PreparedPhoto> photos =
        job.prepare(source.images, stymo::read_known(source));
    Faces result;
    for (stymo::PreparedPhoto& photo : photos) {
        result.faces.push_back(std::move(photo.face));
        result.warnings.push_back(std::move(photo.warnings));
    }
    output.begin(result.faces);
    for (std::size_t i = 0; i < photos.size(); ++i) {
        stymo::write_image(output.of(i) / "aligned.png", photos[i].aligned);
        stymo::write_image(output.of(i) / "overlay.png", photos[i].overlay);
        for (const std::string& warning : result.warnings[i])
            std::cerr << "warning: " << result.faces[i].id << ": " << warning << std::endl;
    }
    return result;
}

Faces faces_of(const Options& options, const stymo::FitJob& job, Output& output) {
    if (options.face.as_it_comes()) return prepared(job, options.face, output);
    Faces result{{stymo::read_face(options.face, job.model().config())}, {}};
    output.begin(result.faces);
    return result;
}

/// Fits and tunes with bars of progress.
stymo::FittedFaces fitted(const stymo::FitJob& job, const std::vector<stymo::Face>& faces,
                          const Output& output) {
    stymo::Progress fitting({.title = "fit", .total = job.options().fit.steps, .unit = "steps"});
    // If time is the limit, progress is in thousandths of the time.
    const stymo::TuningOptions& tuning = job.options().tuning;
    const bool by_steps = tuning.steps > 0;
    const std::int64_t total = by_steps ? tuning.steps : 1000;
    std::optional<stymo::Progress> tuned;
    stymo::FitObserver observer;
    observer.on_fit_step = [&](const stymo::FitStep& step) {
        fitting.update(step.steps, "loss " + std::to_string(step.loss));
    };
    observer.on_fitted = [&](const stymo::FitResult& result) {
        fitting.finish();
        output.write_codes(result);
        if (job.options().tunes() && !stymo::interrupted())
            tuned.emplace(stymo::ProgressTask{
                .title = "tune", .total = total, .unit = by_steps ? "steps" : "parts"});
    };
    observer.on_tuning_step = [&](const stymo::TuningStep& step) {
        const auto part =
            static_cast<std::int64_t>(1000.0 * step.seconds / std::max(tuning.seconds, 1e-3));
        tuned->update(by_steps ? step.steps : std::min(part, total),
                      "loss " + std::to_string(step.loss));
    };
    stymo::FittedFaces done = job.fit(job.batch_of(faces), observer);
    if (tuned) tuned->finish();
    if (done.changes) done.changes->save(output.tuned_file());
    return done;
}

/// The network that measures LPIPS: that of the loss, or the one of the command line, which is read
/// even if the fit does not use the term. Null without one.
const stymo::Lpips* metric_network(const stymo::LpipsOptions& options,
                                   const stymo::ReconstructionConfig& config,
                                   const stymo::ReconstructionLoss& loss,
                                   std::optional<stymo::Lpips>& own) {
    if (loss.lpips() != nullptr) return loss.lpips();
    if (!options.trunk.empty())
        return &own.emplace(stymo::metric_config(options, config.perceptual),
                            "leave out --lpips-trunk");
    return nullptr;
}

/// What is strange about the score of the final image, if the model's first guesses of held-out
/// photos have this PSNR (0: not known); empty if nothing is.
std::string doubt_of(const stymo::FitReport& report, double usual) {
    // With the model that ships (22.7 dB) fits of portraits reach 22 to 29 dB.
    constexpr double far_below = 4.5;
    const double psnr =
        (report.tuned.defined() ? report.tuned_metrics : report.fitted_metrics).psnr;
    std::ostringstream text;
    text << std::fixed << std::setprecision(1) << "the PSNR is " << psnr << " dB";
    if (psnr > stymo::most_plausible_psnr) return text.str() + stymo::implausible_psnr;
    if (psnr < usual - far_below)
        text << ", far below what photos usually reach with this model (its first guesses of "
                "held-out photos: "
             << usual << " dB); look at fit.png and overlay.png";
    return psnr < usual - far_below ? text.str() : std::string();
}

stymo::AppResult reports(const stymo::FitJob& job, const Faces& photos,
                         const stymo::FittedFaces& done, const Output& output,
                         const stymo::Lpips* lpips, double usual) {
    if (lpips == nullptr)
        std::cerr << "LPIPS is not measured; name its weights with --lpips-trunk and --lpips-heads"
                  << std::endl;
    for (const std::string& warning : done.warnings)
        std::cerr << "warning: " << warning << std::endl;
    stymo::AppResult result;
    std::vector<stymo::JsonValue> all;
    for (std::size_t i = 0; i < photos.faces.size(); ++i) {
        const stymo::FitReport report =
            job.report(done, static_cast<std::int64_t>(i), done.faces.mask, lpips, true);
        stymo::JsonValue json = to_json(report, done);
        std::vector<std::string> warnings = done.warnings;
        if (const std::string doubt = doubt_of(report, usual); !doubt.empty()) {
            warnings.push_back(doubt);
            std::cerr << "warning: " << photos.faces[i].id << ": " << doubt << std::endl;
        }
        if (!photos.warnings.empty())
            warnings.insert(warnings.end(), photos.warnings[i].begin(), photos.warnings[i].end());
        if (!photos.warnings.empty() || !warnings.empty()) json.add("warnings", warnings);
        output.write_report(i, report, json);
        all.push_back(std::move(json));
        if (photos.faces.size() > 1) result.text += photos.faces[i].id + "\n";
        result.text += summary(report, done.fit_seconds);
    }
    result.json = all.size() == 1 ? all.front() : stymo::JsonValue::object({{"photos", all}});
    result.incomplete = done.incomplete;
    return result;
}

stymo::AppResult fit(Options& options) {
    stymo::require_photo(options.face);
    stymo::Explainer explainer(options.explain);
    const stymo::Model model = stymo::load_model(options.model);
    const stymo::ReconstructionConfig config =
        stymo::fitting_config(options.lpips, model.config().reconstruction);
    const stymo::ReconstructionLoss loss(config, "--perceptual-weight 0",
                                         model.has_encoder() ? &model.encoder() : nullptr);
    std::optional<stymo::Lpips> own;
    const stymo::Lpips* lpips = metric_network(options.lpips, config, loss, own);
    stymo::FitJobOptions job_options = options.fit.job_options();
    // A folder does not say to which head its codes belong.
    if (options.face.as_it_comes() || !job_options.preparation.morphable.empty())
        job_options.head = job_options.preparation.morphable;
    const stymo::FitJob job(model, loss, std::move(job_options));
    Output output(options.out);
    const Faces photos = faces_of(options, job, output);

    const stymo::InterruptGuard guard;
    const stymo::FittedFaces done = fitted(job, photos.faces, output);
    // The file of the model that ships was written before models had their PSNR.
    const double usual = model.validation_psnr().value_or(options.model.file.empty() ? 22.7 : 0.0);
    stymo::AppResult result = reports(job, photos, done, output, lpips, usual);
    if (job.options().tunes()) explainer.count("tuning_steps", std::ssize(done.tuning.losses));
    explainer.count("photos", std::ssize(photos.faces));
    explainer.count("steps", std::ssize(done.fit.losses));
    explainer.finish(result);
    return result;
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
    line.option("--ignore", options.face.ignore,
                "mask of the photo's own size, white where something covers the face; fit, tuning "
                "and scores leave these pixels out, like those outside the photo");
    line.option(
        "--pose", options.face.pose,
        "JSON file with the pose of an aligned photo; without --mask the whole frame is fitted");
    line.flag("--as-is", options.face.as_is,
              "the photo is aligned like FFHQ and the face is frontal; the whole frame is fitted");
    line.option("--data", options.face.data,
                "folder of faces in the FFHQ format with the photo, its mask and its pose");
    line.option("--id", options.face.id, "id of the photo in --data").needs("--data");
    line.option("--face", options.fit.job.preparation.face,
                "which face of the photo, counted from the left; 0: the largest")
        .range(0, 1000)
        .excludes("--mask")
        .excludes("--pose")
        .excludes("--as-is")
        .excludes("--data");
    line.option("--out", options.out,
                "output folder: fit.png, render.png, codes.json, report.json; also aligned.png and "
                "overlay.png if the photo is prepared, and tuned.safetensors with --tune")
        .required();
    stymo::declare_preparation_files(line, options.fit.job.preparation);
    stymo::declare_fit(line, options.fit);
    stymo::declare_perceptual_weight(line, options.lpips);
    stymo::declare_lpips_files(line, options.lpips);
    stymo::declare_explain(line, options.explain);
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return fit(options); });
}
