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
#include "apps/common/ranked_run.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "apps/fit/fitting.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "fit/fit_job.h"
#include "nn/models/code_file.h"

namespace {

struct Options {
    stymo::ModelOptions model;
    std::filesystem::path images;
    std::filesystem::path video;
    stymo::FilmOptions frames;
    stymo::VideoFitOptions video_fit;
    std::filesystem::path out;
    stymo::FaceSource face;
    stymo::LpipsOptions lpips;
    stymo::FitToolOptions fit;
};

void write_metrics(std::ostream& stream, const char* name, const stymo::ImageMetrics& metrics) {
    stream << std::left << std::setw(9) << name << std::right << std::fixed << std::setprecision(4)
           << std::setw(9) << metrics.l1;
    if (metrics.lpips) stream << std::setw(9) << *metrics.lpips;
    stream << std::setw(9) << metrics.ssim << std::setprecision(2) << std::setw(9) << metrics.psnr
           << '\n';
}

std::string summary(const stymo::FitReport& report, const stymo::FittedFaces& done) {
    std::ostringstream text;
    text << "                L1" << (report.lpips_network.empty() ? "" : "    LPIPS")
         << "     SSIM  PSNR dB\n";
    write_metrics(text, "initial", report.initial_metrics);
    write_metrics(text, "fitted", report.fitted_metrics);
    if (report.tuned.defined()) write_metrics(text, "tuned", report.tuned_metrics);
    text << std::setprecision(1) << "fitting " << done.fit_seconds << " s";
    if (report.tuned.defined()) text << ", tuning " << done.tuning.seconds << " s";
    text << '\n';
    if (!report.lpips_network.empty()) text << "LPIPS: " << report.lpips_network << '\n';
    return text.str();
}

/// The output folder of each photo. What an earlier fit has left there stays until this one has
/// codes.
class Output {
public:
    /// `mark` is that of the model.
    Output(std::filesystem::path folder, std::string mark)
        : folder_(std::move(folder)), mark_(std::move(mark)) {}

    /// Names the folders of the photos and makes them. Several photos get a folder each.
    void begin(const std::vector<stymo::Face>& faces) {
        for (const stymo::Face& face : faces) {
            folders_.push_back(faces.size() == 1 ? folder_ : folder_ / face.id);
            stymo::require_writable_folder(folders_.back());
            stymo::remove_temporary_files(folders_.back());
            replaces_ = replaces_ || std::filesystem::exists(folders_.back() / "codes.json");
        }
        if (replaces_)
            std::cerr << "warning: " << folder_.string() << ": the fit that it holds"
                      << (std::filesystem::exists(tuned_file()) ? " and its tuned weights" : "")
                      << " will be replaced" << std::endl;
    }
    /// Shows what was prepared before the fit, which takes longer.
    void show(std::size_t photo, const stymo::Tensor& aligned, const stymo::Tensor& overlay) {
        previews_.push_back({of(photo), aligned, overlay});
        if (!replaces_) write_previews();
    }
    [[nodiscard]] const std::filesystem::path& of(std::size_t photo) const {
        return folders_.at(photo);
    }
    [[nodiscard]] std::filesystem::path tuned_file() const { return folder_ / "tuned.safetensors"; }
    /// Writes what the fit has found before the decoder is tuned, which takes long; nothing if that
    /// would replace an earlier fit by an interrupted one. Changes of weights and pictures that an
    /// earlier fit has left belong to other codes.
    void write_codes(const stymo::FitResult& result) {
        if (replaces_ && stymo::interrupted()) return;
        has_codes_ = true;
        for (const std::filesystem::path& folder : folders_)
            for (const char* name : {"aligned.png", "overlay.png"})
                if (replaces_) std::filesystem::remove(folder / name);
        write_previews();
        for (std::size_t i = 0; i < folders_.size(); ++i)
            stymo::write_code_file(of(i) / "codes.json", result.fitted,
                                   static_cast<std::int64_t>(i),
                                   stymo::pose_from_camera(result.cameras[i]), mark_);
        std::filesystem::remove(tuned_file());
    }
    [[nodiscard]] bool has_codes() const { return has_codes_; }
    void write_report(std::size_t photo, const stymo::FitReport& report,
                      const stymo::JsonValue& json) const {
        stymo::write_image(of(photo) / "fit.png", stymo::comparison_sheet(report));
        stymo::write_image(of(photo) / "render.png",
                           report.tuned.defined() ? report.tuned : report.fitted);
        stymo::write_file(of(photo) / "report.json", json.text() + "\n", stymo::Durability::none);
    }

private:
    struct Preview {
        std::filesystem::path folder;
        stymo::Tensor aligned, overlay;
    };
    void write_previews() {
        for (const Preview& preview : previews_) {
            stymo::write_image(preview.folder / "aligned.png", preview.aligned);
            stymo::write_image(preview.folder / "overlay.png", preview.overlay);
        }
        previews_.clear();
    }

    std::filesystem::path folder_;
    std::string mark_;
    std::vector<std::filesystem::path> folders_;
    std::vector<Preview> previews_;  ///< not written yet
    bool replaces_ = false;          ///< an earlier fit
    bool has_codes_ = false;
};

/// The photos' faces, and the warnings of those that were prepared.
struct Faces {
    std::vector<stymo::Face> faces;
    std::vector<std::vector<std::string>> warnings;
};

/// Throws UsageError if an output would replace a photo, a mask, or the report of a data set.
void require_inputs_kept(const Options& options) {
    std::vector<std::filesystem::path> inputs{options.face.images.begin(),
                                              options.face.images.end()};
    inputs.insert(inputs.end(), {options.face.mask, options.face.ignore, options.face.pose});
    std::vector<std::filesystem::path> folders{options.out};
    if (options.face.images.size() > 1)
        for (const std::string& image : options.face.images)
            folders.push_back(options.out / std::filesystem::path(image).stem());
    for (const std::filesystem::path& folder : folders)
        for (const char* name :
             {"aligned.png", "overlay.png", "fit.png", "render.png", "codes.json", "report.json"})
            stymo::require_not_read(folder / name, inputs);
    stymo::require_not_read(options.out, {options.face.data});
}

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
        output.show(i, photos[i].aligned, photos[i].overlay);
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
                          Output& output) {
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
    if (done.changes && output.has_codes()) done.changes->save(output.tuned_file());
    return done;
}

stymo::AppResult reports(const stymo::Fitting& fitting, const Faces& photos,
                         const stymo::FittedFaces& done, const Output& output) {
    for (const std::string& warning : done.warnings)
        std::cerr << "warning: " << warning << std::endl;
    stymo::AppResult result;
    std::vector<stymo::JsonValue> all;
    for (std::size_t i = 0; i < photos.faces.size(); ++i) {
        const stymo::FitReport report = fitting.job.report(done, static_cast<std::int64_t>(i),
                                                           done.faces.mask, fitting.lpips, true);
        stymo::JsonValue json = to_json(report, done);
        std::vector<std::string> warnings = done.warnings;
        if (const std::string doubt = fitting.doubt_of(report); !doubt.empty()) {
            warnings.push_back(doubt);
            std::cerr << "warning: " << photos.faces[i].id << ": " << doubt << std::endl;
        }
        if (!photos.warnings.empty())
            warnings.insert(warnings.end(), photos.warnings[i].begin(), photos.warnings[i].end());
        if (!photos.warnings.empty() || !warnings.empty()) json.add("warnings", warnings);
        output.write_report(i, report, json);
        all.push_back(std::move(json));
        if (photos.faces.size() > 1) result.text += photos.faces[i].id + "\n";
        result.text += summary(report, done);
    }
    result.json = all.size() == 1 ? all.front() : stymo::JsonValue::object({{"photos", all}});
    result.incomplete = done.incomplete;
    return result;
}

stymo::FitJobOptions job_options(const Options& options) {
    stymo::FitJobOptions job = options.fit.job_options();
    // A folder in the FFHQ format does not say to which head its codes belong.
    if (options.face.as_it_comes() || !job.preparation.morphable.empty())
        job.head = job.preparation.morphable;
    if (options.images.empty())
        job.preparation.no_face_advice =
            "; if it is an aligned crop already, give --mask and --pose, or --as-is";
    return job;
}

stymo::AppResult fit_folder(const Options& options, const stymo::CommandLine& line) {
    if (!options.face.images.empty() || !options.face.as_it_comes() || !options.face.ignore.empty())
        stymo::fail<stymo::UsageError>(
            "--images prepares the photos of a folder itself: leave out --image, --mask, --ignore, "
            "--pose, --data and --as-is");
    std::optional<stymo::Fitting> fitting;
    std::optional<stymo::FolderFit> folder;
    stymo::Settings settings = line.settings();
    for (auto& [name, value] : settings)
        if (name == "--model") value = stymo::with_checksum(stymo::model_file(options.model));
    stymo::AppResult result = stymo::run_on_ranks("stymo-fit", [&](stymo::Ranks& ranks) {
        return stymo::RankedRun{
            .prepare =
                [&] {
                    stymo::warn_without_landmark_network(options.fit.job.preparation);
                    fitting.emplace(options.model, options.lpips, job_options(options));
                    static_cast<void>(fitting->job.preparation());
                    folder.emplace(*fitting, options.images, options.out, settings, ranks);
                },
            .state = [&] { return folder->state(); },
            .lead = [&] { return folder->lead(); },
            .follow = [&] { folder->follow(); }};
    });
    if (folder) stymo::count_for_report("photos", folder->done_now());
    return result;
}

stymo::AppResult fit(const Options& options, const stymo::CommandLine& line) {
    if (!options.images.empty()) return fit_folder(options, line);
    if (!options.video.empty()) {
        if (options.fit.job_options().tunes())
            stymo::fail<stymo::UsageError>("--video fits codes alone: leave out --tune");
        // The perceptual term takes longer than it gains in a film.
        stymo::LpipsOptions lpips = options.lpips;
        lpips.perceptual_weight = lpips.perceptual_weight.value_or(0.0);
        const stymo::Fitting fitting(options.model, lpips, job_options(options));
        return stymo::fit_video(fitting, options.video, options.out, options.frames,
                                options.video_fit);
    }
    stymo::require_photo(options.face);
    require_inputs_kept(options);
    // The networks take seconds to read.
    for (const std::string& image : options.face.images)
        static_cast<void>(stymo::read_beginning(image, 1));
    const stymo::Fitting fitting(options.model, options.lpips, job_options(options));
    const stymo::FitJob& job = fitting.job;
    Output output(options.out, fitting.mark);
    const Faces photos = faces_of(options, job, output);

    const stymo::InterruptGuard guard;
    const stymo::FittedFaces done = fitted(job, photos.faces, output);
    if (!output.has_codes())
        return {
            "", {}, done.incomplete + "; the earlier fit in " + options.out.string() + " stays"};
    stymo::AppResult result = reports(fitting, photos, done, output);
    if (job.options().tunes())
        stymo::count_for_report("tuning_steps", std::ssize(done.tuning.losses));
    stymo::count_for_report("photos", std::ssize(photos.faces));
    stymo::count_for_report("steps", std::ssize(done.fit.losses));
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
    line.option("--images", options.images,
                "folder of photos of any people, each fitted by itself: one line a photo in "
                "faces.jsonl. The same command continues an interrupted run; mpirun divides the "
                "folder")
        .excludes("--image");
    line.option("--video", options.video,
                "film of one person; writes the codes of each frame to codes.jsonl")
        .excludes("--image")
        .excludes("--images");
    line.option("--mask", options.face.mask,
                "head mask of a photo that is aligned like FFHQ; without --pose the face is "
                "assumed to be frontal")
        .excludes("--video");
    line.option("--ignore", options.face.ignore,
                "mask of the photo's own size, white where something covers the face; fit, tuning "
                "and scores leave these pixels out, like those outside the photo")
        .excludes("--video");
    line.option(
            "--pose", options.face.pose,
            "JSON file with the pose of an aligned photo; without --mask the whole frame is fitted")
        .excludes("--video");
    line.flag("--as-is", options.face.as_is,
              "the photo is aligned like FFHQ and the face is frontal; the whole frame is fitted")
        .excludes("--video")
        .excludes("--mask");
    line.option("--data", options.face.data,
                "folder of faces in the FFHQ format with the photo, its mask and its pose")
        .excludes("--video")
        .excludes("--image");
    line.option("--id", options.face.id, "id of the photo in --data").needs("--data");
    line.option("--face", options.fit.job.preparation.face,
                "which face of the photo, counted from the left; 0: the clearest")
        .range(0, 1000)
        .excludes("--video")
        .excludes("--mask")
        .excludes("--pose")
        .excludes("--as-is")
        .excludes("--data");
    line.option("--out", options.out,
                "output folder: fit.png, render.png, codes.json, report.json; also aligned.png and "
                "overlay.png if the photo is prepared, and tuned.safetensors with --tune. With "
                "--images: faces.jsonl, codes/ID.json, fits/ID.jpg, tuned/ID.safetensors, "
                "report.json")
        .required()
        .keeps_results();
    stymo::declare_preparation_files(line, options.fit.job.preparation);
    stymo::declare_fit(line, options.fit);
    for (const char* name : {"--steps", "--depth-weight", "--tune-learning-rate",
                             "--tune-perceptual", "--tune-depth", "--tune-identity", "--locality"})
        line.refine(name).excludes("--video");
    stymo::declare_video(line, options.video_fit);
    stymo::declare_film(line, options.frames);
    stymo::declare_perceptual_weight(line, options.lpips);
    stymo::declare_lpips_files(line, options.lpips);
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return fit(options, line); });
}
