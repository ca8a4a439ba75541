#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/bench/report/omitted.h"
#include "core/angle.h"
#include "core/clock.h"
#include "core/median.h"
#include "nn/models/view.h"

namespace stymo {

namespace {

/// Of a head that is turned by `yaw` radians, from `distances` times as far, moved by `shift` of the picture's side.
Camera scene_camera(const Model& model, double yaw, double distances, double shift) {
    const CameraConfig& place = model.config().camera;
    Pose pose = pivot_pose(yaw, 0.0, 0.0, distances * place.distance, place.pivot_depth);
    pose.translation[0] += shift * place.distance / place.intrinsics.focal;
    return camera_from_pose(pose, place.intrinsics);
}

Scene scene(const Model& model, const std::string& name, const std::string& what, double yaw, double distances, double shift) {
    constexpr double a_little = 0.002;
    return {name, what, scene_camera(model, yaw, distances, shift), scene_camera(model, yaw + a_little, distances, shift)};
}

}  // namespace

std::vector<Scene> omitted_scenes(const Model& model) {
    const double profile = radians_from_degrees(70.0);
    std::vector<Scene> scenes{scene(model, "frontal", "one head, frontal", 0.0, 1.0, 0.0),
                              scene(model, "profile", "one head, turned by 70 degrees", profile, 1.0, 0.0),
                              scene(model, "far away", "one head from twice as far", 0.0, 2.0, 0.0),
                              scene(model, "half outside", "one head, half of it outside of the frame", 0.0, 1.0, 0.5),
                              scene(model, "empty", "a field without any density", 0.0, 1.0, 0.0)};
    scenes.back().empty = true;
    return scenes;
}

void empty_field(const Model& model) {
    constexpr double nothing = -60.0;  // softplus(-60) = 1e-26
    for (const Parameter& parameter : model.parameters().all())
        if (parameter.name() == "decoder.field.density.bias") parameter.set_value(Tensor::full({1}, nothing));
}

SceneFrames scene_frames(const Model& model, const Codes& codes, const Scene& scene, RenderMode mode, std::int64_t samples,
                         int repeats) {
    FaceRenderer renderer(model, {.mode = mode, .samples_per_ray = samples});
    renderer.show(codes);
    // Whatever these views need to learn is learnt, and all that is kept is allocated.
    static_cast<void>(renderer.render(scene.camera));
    static_cast<void>(renderer.render(scene.beside));
    SceneFrames frames;
    {
        const WorkMeter meter;
        frames.picture = renderer.render(scene.camera).picture;
        frames.work = meter.counts();
        frames.counts = renderer.counts();
    }
    const double least_seconds = 0.04 * repeats;
    constexpr int most = 500;
    std::vector<double> seconds;
    const double begin = seconds_now();
    for (int i = 0; i < repeats || (i < most && seconds_now() - begin < least_seconds); ++i) {
        const double start = seconds_now();
        static_cast<void>(renderer.render(i % 2 == 0 ? scene.beside : scene.camera));
        seconds.push_back(seconds_now() - start);
    }
    frames.seconds = median(std::move(seconds));
    return frames;
}

}  // namespace stymo
