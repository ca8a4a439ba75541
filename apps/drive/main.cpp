#include <cmath>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <optional>
#include <sstream>

#include "apps/common/coefficient_files.h"
#include "apps/common/command_line.h"
#include "apps/common/fit_options.h"
#include "apps/common/table.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "apps/drive/driven_face.h"
#include "apps/drive/film_report.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/film.h"
#include "core/io/image.h"
#include "core/ops/ops.h"
#include "core/progress.h"
#include "fit/expression_prior.h"
#include "fit/photo/prepared_photos.h"
#include "fit/video/film_follower.h"
#include "nn/models/code_file.h"
#include "nn/models/identity_network.h"
#include "render/morphable/head_source.h"

namespace {

namespace fs = std::filesystem;

struct Options {
    stymo::ModelOptions model;
    fs::path codes, video, coefficients, out, sheet, truth;
    double rate = 60.0;
    stymo::DrivenFaceOptions driven;
    stymo::PhotoPreparationSettings preparation;
    stymo::FilmOptions film;
};

/// A face that is driven; says how exact its images are.
stymo::DrivenFace driven_face(const Options& options, const stymo::Model& shown,
                              stymo::CodeFile face, const stymo::FaceDetector* detector) {
    stymo::DrivenFace driven(options.driven, shown, std::move(face), detector);
    std::cerr << "the face at rest: " << error_words(driven.renderer()) << std::endl;
    return driven;
}

using FrameSink = std::function<void(const stymo::FilmFrame&)>;

/// Writes the film of the frames that `run` hands over. Returns the seconds of rendering.
double write_film(const Options& options, stymo::DrivenFace& driven, double rate,
                  const std::function<void(const FrameSink&)>& run) {
    double rendering = 0.0;
    stymo::write_whole(
        options.out,
        [&](const fs::path& temporary) {
            std::optional<stymo::FilmWriter> writer;
            run([&](const stymo::FilmFrame& frame) {
                const double start = stymo::seconds_now();
                const stymo::Tensor image = driven.frame(frame);
                if (!writer)
                    writer.emplace(options.out, temporary, image.shape(0), image.shape(1), rate);
                writer->add(image);
                rendering += stymo::seconds_now() - start;
            });
            if (stymo::interrupted()) stymo::fail("interrupted; nothing was written");
            writer->finish();
        },
        stymo::Durability::none);
    return std::max(rendering, 1e-9);
}

/// Puts the sound of --video under the new film. Returns what is to be said of it.
std::string keep_sound(const Options& options) {
    if (options.film.first_frame > 0 || options.film.most_frames > 0)
        return "left out, because this is a part of the film";
    try {
        switch (stymo::add_sound(options.video, options.out)) {
            case stymo::FilmSound::kept: return "kept";
            case stymo::FilmSound::none: return "none";
            case stymo::FilmSound::other:
                return "left out, because MP4 files do not have sound of its encoding";
        }
    } catch (const stymo::FileError& error) {
        return std::string("left out: ") + error.what();
    }
    return {};
}

/// Adds what was measured to the result. `detector` is used with --truth alone.
void add_measures(const Options& options, const stymo::DrivenFace::Measures& measures,
                  const stymo::FaceDetector* detector, stymo::AppResult& result) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(2);
    if (!options.truth.empty()) {
        const stymo::LandmarkError error =
            stymo::landmark_error(options.out, options.truth, *detector);
        if (error.frames == 0)
            text << "\nlandmarks: no frame shows a face in " << options.truth.string()
                 << " and in the new film";
        else
            text << "\nlandmarks: mouth " << error.mouth << " and face " << error.face
                 << " percent of the distance of the eyes from " << options.truth.string() << " in "
                 << error.frames << " frames";
        // NaN becomes null.
        result.json.add("mouth_error", error.mouth)
            .add("face_error", error.face)
            .add("compared_frames", error.frames);
    }
    if (options.driven.measure) {
        const auto percent = [](double mean) {
            return std::isnan(mean)
                       ? std::string("unknown, no three frames in a row show a face")
                       : stymo::decimal(mean, 2) + " percent of the distance of the eyes";
        };
        text << "\nacceleration of landmarks: " << percent(measures.driven.mean())
             << "; in the given film: " << percent(measures.film.mean());
        result.json.add("jitter", measures.driven.mean()).add("jitter_given", measures.film.mean());
    }
    if (measures.compared > 0) {
        const double mean = measures.cosines / static_cast<double>(measures.compared);
        text << "\nidentity: cosine " << mean << " to the face at rest, at least "
             << measures.least_cosine;
        result.json.add("identity", mean).add("identity_least", measures.least_cosine);
    }
    result.text += text.str();
}

stymo::AppResult drive_by_film(const Options& options, const stymo::Model& model,
                               const stymo::Model& shown, stymo::CodeFile face) {
    const stymo::PhotoPreparation preparation(
        stymo::settings_for(model.config(), options.preparation));
    stymo::FilmOptions frames = options.film;
    frames.on_progress = stymo::video_progress();
    const stymo::FilmFollower follower(preparation, model, options.video, frames, false);
    stymo::DrivenFace driven =
        driven_face(options, shown, std::move(face), &preparation.detector());
    const stymo::FilmFrame first{.change = stymo::unmoved(),
                                 .pose = stymo::frontal_pose(model.config().camera)};
    stymo::FilmSummary summary;
    const double rendering =
        write_film(options, driven, follower.frames_per_second(),
                   [&](const FrameSink& sink) { summary = follower.run(first, {}, sink); });
    summary.seconds -= rendering;
    const std::string sound = keep_sound(options);
    const double rate = static_cast<double>(summary.frames) / rendering;
    stymo::AppResult result{
        stymo::text_from(text_of(summary), " followed, ", stymo::decimal(rate, 2), " rendered; ",
                         summary.frames - summary.found,
                         " frames without the face hold the last one"),
        to_json(summary)};
    add_measures(options, driven.measures(), &preparation.detector(), result);
    if (!options.sheet.empty())
        stymo::write_image(options.sheet, stymo::contact_sheet(options.video, options.out,
                                                               summary.frames, options.film));
    result.text += "\nsound: " + sound;
    result.json.add("rendering_seconds", rendering).add("sound", sound);
    return result;
}

stymo::AppResult drive_by_coefficients(const Options& options, const stymo::Model& model,
                                       const stymo::Model& shown, const stymo::CodeFile& face) {
    const std::vector<stymo::ArkitMoment> rows = stymo::read_coefficients(options.coefficients);
    const fs::path& morphable = options.preparation.morphable;
    const stymo::ArkitConversion conversion = stymo::arkit_conversion(morphable);
    const stymo::PlausibleChanges plausible(model, stymo::morphable_head_from(morphable));
    stymo::FilmFrame frame{.found = true, .change = stymo::unmoved()};
    stymo::DrivenFace driven = driven_face(options, shown, face, nullptr);
    const double rendering = write_film(options, driven, options.rate, [&](const FrameSink& sink) {
        stymo::Progress progress({.title = "frames", .total = std::ssize(rows), .unit = "frames"});
        for (const stymo::ArkitMoment& row : rows) {
            if (stymo::interrupted()) return;
            const std::vector<float> code = conversion.code(row.coefficients);
            frame.change =
                plausible(stymo::Tensor::from({1, std::ssize(code)}, std::span<const float>(code)));
            frame.pose.yaw = row.view[0];
            frame.pose.pitch = row.view[1];
            frame.roll = row.view[2];
            sink(frame);
            progress.update(++frame.index);
        }
    });
    const double rate = static_cast<double>(rows.size()) / rendering;
    stymo::AppResult result{
        stymo::text_from(rows.size(), " frames, ", stymo::decimal(rate, 2), " rendered a second"),
        stymo::JsonValue::object({{"frames", std::ssize(rows)}, {"rendering_seconds", rendering}})};
    std::optional<stymo::FaceDetector> detector;
    if (!options.truth.empty()) detector.emplace(options.preparation.landmark_model);
    add_measures(options, driven.measures(), detector ? &*detector : nullptr, result);
    return result;
}

stymo::AppResult drive(const Options& options) {
    if (options.video.empty() == options.coefficients.empty())
        stymo::fail<stymo::UsageError>("give --video or --coefficients");
    if (options.video.empty() && options.truth.empty() &&
        options.preparation.landmark_model != stymo::shipped_landmark_network())
        stymo::fail<stymo::UsageError>("--landmarks requires --video or --truth");
    stymo::require_extension(options.out, {".mp4"});
    if (options.video.empty()) stymo::require_extension(options.coefficients, {".csv", ".json"});
    stymo::require_folder_of(options.out);
    if (!options.sheet.empty()) {
        stymo::require_extension(options.sheet, {".png", ".jpg"});
        stymo::require_folder_of(options.sheet);
    }
    stymo::require_not_read(options.out, {options.video, options.truth});
    for (const fs::path& film : {options.truth, options.video})
        if (!film.empty()) static_cast<void>(stymo::FilmReader(film));
    stymo::CodeFile face = stymo::read_own_codes(options.codes, options.model);
    const stymo::Model model = stymo::load_model({options.model.file, {}});
    // A film takes long to read.
    if (options.driven.size > 0)
        static_cast<void>(model.decoder().ladder().count_up_to(options.driven.size));
    if (!options.driven.identity.empty())
        static_cast<void>(stymo::IdentityNetwork(options.driven.identity));
    std::optional<stymo::Model> tuned;
    if (!options.model.tuned.empty())
        tuned.emplace(stymo::load_model(options.model, stymo::ModelParts::decoder));
    const stymo::Model& shown = tuned ? *tuned : model;
    const stymo::InterruptGuard guard;
    return options.video.empty() ? drive_by_coefficients(options, model, shown, face)
                                 : drive_by_film(options, model, shown, std::move(face));
}

}  // namespace

int stymo_drive(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-drive",
                            "Puts the expression and the pose of the face in a film, or "
                            "coefficients of ARKit's shapes, onto another face.",
                            stymo::MatmulPrecision::medium);
    stymo::declare_model(line, options.model);
    stymo::declare_tuned(line, options.model);
    line.option("--codes", options.codes, "codes.json of the face that is moved").required();
    line.option("--video", options.video, "film of the face that moves it");
    line.option("--coefficients", options.coefficients,
                "in place of a film: CSV of Live Link Face, or .json of stymo-export arkit")
        .excludes("--video");
    line.option("--rate", options.rate, "with --coefficients: rows, and frames, a second")
        .range(1, 240)
        .needs("--coefficients");
    line.option("--out", options.out, "the new film, X.mp4").required();
    line.option("--size", options.driven.size,
                "side of the frames: 64, 128, 256 or 512; 0: the model's resolution")
        .range(0, 512);
    line.option("--psnr", options.driven.psnr,
                "decibels that the face at rest has, from 40 degrees to either side, against exact "
                "images of the same --matmul-precision; six of them are checked")
        .range(20, 90);
    line.flag("--absolute", options.driven.absolute,
              "the expressions of the film or of the coefficients replace the face's own; by "
              "default they are added to it");
    line.flag("--measure", options.driven.measure,
              "also measure how much the landmarks tremble in both films; slower")
        .excludes("--coefficients");
    line.option("--sheet", options.sheet,
                "also write a picture of both films: frames of --video above those of --out")
        .excludes("--coefficients");
    line.option("--truth", options.truth,
                "what the new film should show: also measure how far its landmarks are from this "
                "film's");
    line.option("--identity", options.driven.identity,
                "weights of MobileFaceNet, written by stymo-weights import: also measure whether "
                "the face stays the same person");
    stymo::declare_film(line, options.film);
    stymo::declare_landmark_files(line, options.preparation);
    line.refine("--pose-net").needs("--video");
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return drive(options); });
}
