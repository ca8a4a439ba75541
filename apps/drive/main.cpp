#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <numeric>
#include <optional>
#include <sstream>

#include "apps/common/child_process.h"
#include "apps/common/command_line.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "apps/common/video_options.h"
#include "apps/drive/film_measures.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/film.h"
#include "core/ops/elementwise.h"
#include "core/progress.h"
#include "fit/video/video_fit.h"
#include "nn/models/code_file.h"
#include "nn/models/identity_network.h"
#include "nn/realtime/face_renderer.h"

namespace {

namespace fs = std::filesystem;

struct Options {
    stymo::ModelOptions model;
    fs::path codes, video, out, identity;
    std::int64_t size = 0;
    bool absolute = false;
    bool measure = false;
    stymo::FitJobOptions job;
    stymo::VideoFitOptions fit;
};

/// What is measured of the rendered frames.
struct Measures {
    stymo::LandmarkJitter film, driven;
    double least_cosine = 1.0, cosines = 0.0;
    std::int64_t compared = 0;
};

/// Renders the face with the expression and the pose of each frame of a film.
class Driven {
public:
    Driven(const Options& options, const stymo::Model& model, stymo::CodeFile face,
           const stymo::VideoFit& video, const stymo::FaceDetector& detector)
        : options_(options),
          model_(model),
          detector_(detector),
          face_(std::move(face)),
          neutral_(video.person().expression()),
          renderer_(model, {.mode = model.decoder().folds() ? stymo::RenderMode::skip
                                                            : stymo::RenderMode::exact,
                            .samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
                            .resolution = options.size,
                            .remove_floaters = true}) {
        if (options.identity.empty()) return;
        identity_.emplace(options.identity);
        embedding_ = embedding_of(rendered(face_.codes, 0.0, 0.0, 0.0));
    }

    [[nodiscard]] stymo::Tensor frame(const stymo::FittedFrame& seen) {
        if (seen.found || !last_.defined()) {
            stymo::Codes codes = face_.codes;
            stymo::Variable& expression = codes.groups[1];
            expression = options_.absolute ? seen.codes.expression()
                                           : expression + (seen.codes.expression() - neutral_);
            last_ = rendered(codes, seen.pose.yaw, seen.pose.pitch, seen.roll);
            if (seen.found) measure(seen);
        } else {
            measures_.film.add({});
            measures_.driven.add({});
        }
        return last_;
    }
    [[nodiscard]] const Measures& measures() const { return measures_; }

private:
    [[nodiscard]] stymo::Tensor rendered(const stymo::Codes& codes, double yaw, double pitch,
                                         double roll) {
        renderer_.show(codes);
        return renderer_.render(stymo::model_camera(model_, yaw, pitch, roll)).image;
    }
    [[nodiscard]] std::vector<double> embedding_of(const stymo::Tensor& image) const {
        const stymo::Variable row(image.reshaped({1, image.shape(0), image.shape(1), 3}));
        return identity_->embeddings(row * 2.0 - 1.0).value().to_vector();
    }
    void measure(const stymo::FittedFrame& seen) {
        if (options_.measure) {
            if (seen.starts) {
                measures_.film.add({});
                measures_.driven.add({});
            }
            measures_.film.add(seen.landmarks);
            const auto faces = detector_.find(last_, stymo::FaceSearch::quick);
            measures_.driven.add(faces.empty() ? std::optional<stymo::Landmarks>()
                                               : faces.front().landmarks);
        }
        if (!identity_) return;
        const std::vector<double> other = embedding_of(last_);
        const double cosine =
            std::inner_product(embedding_.begin(), embedding_.end(), other.begin(), 0.0);
        measures_.least_cosine = std::min(measures_.least_cosine, cosine);
        measures_.cosines += cosine;
        ++measures_.compared;
    }

    const Options& options_;
    const stymo::Model& model_;
    const stymo::FaceDetector& detector_;
    stymo::CodeFile face_;
    stymo::Variable neutral_;
    stymo::FaceRenderer renderer_;
    std::optional<stymo::IdentityNetwork> identity_;
    std::vector<double> embedding_;
    stymo::Tensor last_;
    Measures measures_;
};

/// Puts the sound of `film` under the silent film `file`. Returns what is to be said of it.
std::string add_sound(const fs::path& film, const fs::path& file) {
    const fs::path with_sound = file.parent_path() / ("sound-" + file.filename().string());
    // Sound that fits into an MP4 file as it is is copied; other sound is encoded again.
    for (const char* codec : {"copy", "aac"}) {
        const stymo::ChildOutcome outcome =
            stymo::run_child({"ffmpeg", "-nostdin", "-loglevel", "error", "-y", "-i", file.string(),
                              "-i", film.string(), "-map", "0:v", "-map", "1:a?", "-c:v", "copy",
                              "-c:a", codec, with_sound.string()});
        if (outcome.exit_code == 0) {
            fs::rename(with_sound, file);
            return {};
        }
        std::error_code ignored;
        fs::remove(with_sound, ignored);
        constexpr int no_such_program = 127;
        if (outcome.exit_code == no_such_program)
            return "the film is silent: the program ffmpeg, which copies sound, was not found";
    }
    return "the film is silent: ffmpeg could not copy the sound";
}

stymo::AppResult drive(const Options& options) {
    stymo::require_extension(options.out, {".mp4"});
    stymo::require_folder_of(options.out);
    stymo::CodeFile face = stymo::read_own_codes(options.codes, options.model);
    const stymo::Model model = stymo::load_model({options.model.file, {}});
    std::optional<stymo::Model> tuned;
    if (!options.model.tuned.empty())
        tuned.emplace(stymo::load_model(options.model, stymo::ModelParts::decoder));
    stymo::ReconstructionConfig config = model.config().reconstruction;
    config.perceptual_weight = 0.0;
    const stymo::ReconstructionLoss loss(config);
    const stymo::FitJob job(model, loss, options.job);
    const stymo::InterruptGuard guard;
    const stymo::VideoFit video(job, options.video, options.fit);
    Driven driven(options, tuned ? *tuned : model, std::move(face), video,
                  job.preparation().detector());
    stymo::VideoSummary summary;
    std::string sound;
    double rendering = 0.0;
    stymo::write_whole(
        options.out,
        [&](const fs::path& temporary) {
            std::optional<stymo::FilmWriter> writer;
            stymo::Progress progress({.title = "drive", .total = video.frames(), .unit = "frames"});
            summary = video.run([&](const stymo::FittedFrame& frame) {
                const double start = stymo::seconds_now();
                const stymo::Tensor image = driven.frame(frame);
                if (!writer)
                    writer.emplace(options.out, temporary, image.shape(0), image.shape(1),
                                   video.frames_per_second());
                writer->add(image);
                rendering += stymo::seconds_now() - start;
                progress.update(frame.index + 1);
            });
            if (stymo::interrupted()) stymo::fail("interrupted; nothing was written");
            writer->finish();
            sound = add_sound(options.video, temporary);
        },
        stymo::Durability::none);
    summary.seconds -= rendering;
    stymo::AppResult result{text_of(summary) + " fitted", to_json(summary)};
    std::ostringstream text;
    text << std::fixed << std::setprecision(2) << ", "
         << static_cast<double>(summary.frames) / std::max(rendering, 1e-9) << " rendered; "
         << summary.frames - summary.found << " frames without the face hold the last one";
    const Measures& measures = driven.measures();
    if (options.measure) {
        text << "\nacceleration of landmarks: " << measures.driven.mean()
             << " percent of the distance of the eyes, in the given film " << measures.film.mean();
        result.json.add("jitter", measures.driven.mean()).add("jitter_given", measures.film.mean());
    }
    if (measures.compared > 0) {
        const double mean = measures.cosines / static_cast<double>(measures.compared);
        text << "\nidentity: cosine " << mean << " to the face at rest, at least "
             << measures.least_cosine;
        result.json.add("identity", mean).add("identity_least", measures.least_cosine);
    }
    if (!sound.empty()) text << '\n' << sound;
    result.json.add("rendering_seconds", rendering);
    result.json.add("sound", sound.empty() ? stymo::JsonValue("kept") : stymo::JsonValue(sound));
    result.text += text.str();
    return result;
}

}  // namespace

int stymo_drive(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-drive",
                            "Puts the expression and the pose of the face in a film onto another "
                            "face.",
                            stymo::MatmulPrecision::medium);
    stymo::declare_model(line, options.model);
    stymo::declare_tuned(line, options.model);
    line.option("--codes", options.codes, "codes.json of the face that is moved").required();
    line.option("--video", options.video, "film of the face that moves it").required();
    line.option("--out", options.out, "the new film, X.mp4").required();
    line.option("--size", options.size,
                "side of the frames: 64, 128, 256 or 512; 0: the model's resolution")
        .range(0, 512);
    line.flag("--absolute", options.absolute,
              "give the face the expressions of the film themselves; by default it gets what "
              "differs from their mean");
    line.flag("--measure", options.measure,
              "also measure how much the landmarks tremble in both films; slower");
    line.option("--identity", options.identity,
                "weights of MobileFaceNet, written by stymo-weights import: also measure whether "
                "the face stays the same person");
    stymo::declare_video(line, options.fit);
    stymo::declare_preparation_files(line, options.job.preparation);
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return drive(options); });
}
