#include <catch2/catch.hpp>
#include <iostream>

#include "core/error.h"
#include "core/io/film.h"
#include "core/io/scratch_folder.h"
#include "fit/shipped_files.h"
#include "fit/studio.h"
#include "fit/video/acted_frame.h"
#include "fit/video/film_follower.h"
#include "fit/video/live_face.h"
#include "fit/video/video_fit.h"
#include "support/tiny_model.h"

namespace video_tests {

using namespace stymo;

namespace {

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
    const Eigen::Map<const Eigen::ArrayXd> x(a.data(), std::ssize(a)), y(b.data(), std::ssize(b));
    const Eigen::ArrayXd u = x - x.mean(), v = y - y.mean();
    return (u * v).sum() / std::sqrt(u.square().sum() * v.square().sum());
}

}  // namespace

TEST_CASE("Options of films that are out of range are refused before the film is read") {
    const Model model = test::tiny_model();
    const PhotoPreparation preparation(settings_for(model.config(), {}));
    for (const FilmOptions& wrong :
         {FilmOptions{.first_frame = -1}, FilmOptions{.every = 0}, FilmOptions{.most_frames = -1},
          FilmOptions{.window = 0}, FilmOptions{.key_frames = 0}})
        CHECK_THROWS_AS(FilmFollower(preparation, model, "none.mp4", wrong, false), ValueError);
    CHECK_THROWS_AS(FilmFollower(preparation, model, "none.mp4", {}, false), FileError);
}

TEST_CASE("Photos for fits are cut out as those for training, unless a pose network sees them") {
    const ModelConfig model = test::tiny_model_config();
    CHECK(settings_for(model, {}).whole_head);
    PhotoPreparationSettings with_network;
    with_network.pose_network = "pose.onnx";
    CHECK_FALSE(settings_for(model, with_network).whole_head);
}

TEST_CASE("A mouth that opens before the camera and closes again is seen to") {
    if (!FaceDetector::available()) return;
    const Model model = test::tiny_model();
    PhotoPreparationSettings settings;
    settings.landmark_model = shipped_landmark_network();
    const PhotoPreparation preparation(settings_for(model.config(), settings));
    LiveFace live(preparation, model);
    const auto seen_jaw = [&](float jaw) {
        double seen = 0.0;
        for (int i = 0; i < 10; ++i) {
            Tensor frame = empty_frame(0.35);
            static_cast<void>(draw(frame, 1, {.jaw = jaw, .left = 190}));
            const std::optional<LiveFace::Sight> sight = live.see(frame);
            REQUIRE(sight);
            seen = sight->change.to_vector()[0];
        }
        return seen;
    };
    CHECK(std::abs(seen_jaw(0.0F)) < 0.05);
    const double open = seen_jaw(1.5F);
    CHECK(open > 0.3);
    CHECK(std::abs(seen_jaw(0.0F)) < 0.05);
}

TEST_CASE("Poses and expressions of a film are those with which it was drawn", "[slow]") {
    if (!FaceDetector::available()) return;
    const ScratchFolder folder;
    FilmWriter writer(folder / "a.mp4", folder / "a.mp4", frame_height, frame_width, 25.0);
    for (int i = 0; i < 32; ++i) {
        Tensor frame = empty_frame(0.35);
        static_cast<void>(draw_scene(frame, i));
        writer.add(frame);
    }
    writer.finish();
    const Studio studio;
    ReconstructionConfig config = studio.model().config().reconstruction;
    config.perceptual_weight = 0.0;
    const ReconstructionLoss loss(config);
    const FitJob job(studio.model(), loss, studio.fit_options());
    const VideoFit video(job, folder / "a.mp4", {}, {.key_steps = 10});
    std::vector<double> yaw, true_yaw, jaw, true_jaw;
    const VideoSummary summary = video.run([&](const FilmFrame& frame) {
        if (!frame.found || is_covered(static_cast<int>(frame.index))) return;
        const double phase = 2.0 * std::numbers::pi * static_cast<double>(frame.index) / 32.0;
        yaw.push_back(frame.pose.yaw);
        true_yaw.push_back(0.4 * std::sin(phase));
        jaw.push_back(frame.codes.expression().value().to_vector()[0]);
        true_jaw.push_back(1.0 - std::cos(3.0 * phase));
    });
    CHECK(summary.film.frames == 32);
    CHECK(yaw.size() == 28);
    CHECK(correlation(yaw, true_yaw) > 0.97);
    CHECK(correlation(jaw, true_jaw) > 0.5);

    LiveFace live(job.preparation(), studio.model());
    std::vector<double> live_yaw, live_jaw, shown_yaw, shown_jaw;
    for (int i = 0; i < 32; ++i) {
        Tensor frame = empty_frame(0.35);
        static_cast<void>(draw_scene(frame, i));
        const std::optional<LiveFace::Sight> sight = live.see(frame);
        if (!sight || is_covered(i)) continue;
        const double phase = 2.0 * std::numbers::pi * i / 32.0;
        live_yaw.push_back(sight->yaw);
        shown_yaw.push_back(0.4 * std::sin(phase));
        live_jaw.push_back(sight->change.to_vector()[0]);
        shown_jaw.push_back(1.0 - std::cos(3.0 * phase));
    }
    CHECK(live_yaw.size() == 28);
    CHECK(correlation(live_yaw, shown_yaw) > 0.97);
    CHECK(correlation(live_jaw, shown_jaw) > 0.4);
}

}  // namespace video_tests
