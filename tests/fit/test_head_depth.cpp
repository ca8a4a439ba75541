// The linear head as a target for depth: its surface, its place and the loss.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/median.h"
#include "core/ops/ops.h"
#include "fit/fitter.h"
#include "fit/head_depth.h"
#include "fit/tuning.h"
#include "nn/realtime/view.h"
#include "render/depth_map.h"
#include "render/morphable/builtin_head.h"
#include "render/morphable/face_surface.h"
#include "support/tiny_model.h"

namespace head_depth_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::int64_t side = 32;

const MorphableHead& head() {
    return builtin_head();
}

/// Codes of the linear head.
Tensor code(std::int64_t size, double value) {
    return Tensor::full({1, size}, value);
}

FaceBatch batch_of(const Camera& camera) {
    FaceBatch faces;
    faces.cameras = {camera};
    for (std::size_t group = 0; group < code_sizes.size(); ++group)
        faces.codes[group] = code(code_sizes[group], group == 0 ? 0.5 : 0.0);
    faces.code_present = Tensor::full({1}, 1.0);
    return faces;
}

/// A frozen model, codes, and a batch whose photo is the model's own image of them.
struct RenderedFace {
    Model model = tiny_model(1);
    Codes codes = random_codes(1, 7);
    Camera camera = model_camera(model, 0.0, 0.0, 0.0);
    FaceBatch faces = batch_of(camera);
    ReconstructionLoss loss{model.config().reconstruction};

    RenderedFace() {
        model.parameters().set_trainable("", false);
        faces.targets = {
            model.decoder()(codes, {camera}, {.samples_per_ray = 16}).images.back().value()};
    }
    [[nodiscard]] Tensor depths_of(const Model& other) const {
        return render_view(other, codes, 0, camera, {.samples_per_ray = 16, .depth = true}).depth;
    }
};

Tensor vertices_of_batch() {
    const Tensor identity = code(code_sizes[0], 0.5), expression = code(code_sizes[1], 0.0);
    return head_vertices(head(), identity.values<float>(), expression.values<float>());
}

double mean_distance(const std::vector<double>& differences) {
    double sum = 0.0;
    for (const double difference : differences) sum += std::abs(difference);
    return sum / static_cast<double>(differences.size());
}

}  // namespace

TEST_CASE("A face's surface lies on the head and within its landmarks", "[head_depth]") {
    const Camera camera = camera_from_pose(orbit_pose(0.3, 0.1, 0.0, 5.3), {});
    const Tensor vertices = vertices_of_batch();
    const FaceSurface surface = face_surface(head(), vertices, camera, side);
    const std::span<const float> face = surface.face.values<float>();
    const auto rays = std::ranges::count(face, 1.0F);
    CHECK(rays + std::ranges::count(face, 0.0F) == side * side);
    CHECK(rays > side * side / 20);
    CHECK(rays < side * side / 3);
    double worst = 0.0;
    for (std::int64_t i = 0; i < side * side; ++i) {
        if (face[static_cast<std::size_t>(i)] == 0.0F) continue;
        const Eigen::Vector2d place((static_cast<double>(i % side) + 0.5) / side,
                                    (static_cast<double>(i / side) + 0.5) / side);
        const Eigen::Vector3d point = point_at(camera, surface.depth, place);
        double nearest = 1e9;
        for (std::int64_t v = 0; v < head().vertex_count(); ++v) {
            const float* values = vertices.values<float>().data() + 3 * v;
            nearest = std::min(nearest,
                               (Eigen::Vector3d(values[0], values[1], values[2]) - point).norm());
        }
        worst = std::max(worst, nearest);
    }
    // A point of a triangle is no farther from a vertex than the triangle is wide.
    CHECK(worst < 0.15);
}

TEST_CASE("A head is moved along the line of sight to where the face is", "[head_depth]") {
    const Camera camera = camera_from_pose(orbit_pose(-0.2, 0.0, 0.0, 5.3), {});
    const Tensor vertices = vertices_of_batch();
    const FaceSurface surface = face_surface(head(), vertices, camera, side);
    Tensor depths = surface.depth;
    for (float& depth : depths.mutable_values<float>()) depth += 0.25F;
    CHECK(median(depth_differences(depths, surface)) == Approx(0.25).margin(1e-5));
    const Tensor moved = moved_to_depth(head(), vertices, camera, depths);
    // The rays meet other points of the moved head.
    CHECK(std::abs(median(depth_differences(depths, face_surface(head(), moved, camera, side)))) <
          0.02);
    CHECK(eye_distance(head(), moved) == Approx(eye_distance(head(), vertices)).epsilon(1e-5));
    CHECK_THROWS_AS(depth_differences(Tensor::zeros({8, 8, 1}), surface), ShapeError);
}

TEST_CASE("Faces without a code or a head have no target", "[head_depth]") {
    const Camera camera = camera_from_pose(orbit_pose(0.0, 0.0, 0.0, 5.3), {});
    FaceBatch faces = batch_of(camera);
    CHECK(HeadDepth(&head(), faces).surface(0, camera, side));
    CHECK_FALSE(HeadDepth(nullptr, faces).surface(0, camera, side));
    faces.code_present = Tensor::zeros({1});
    CHECK_FALSE(HeadDepth(&head(), faces).surface(0, camera, side));
    faces.code_present = {};
    CHECK_FALSE(HeadDepth(&head(), faces).surface(0, camera, side));
}

TEST_CASE("The loss of a fit has the mean difference of depths in distances of the eyes",
          "[head_depth]") {
    const RenderedFace face;
    const auto losses = [&](const MorphableHead* known, double weight) {
        return fit_codes(face.model, face.loss, face.faces,
                         {.initial = face.codes,
                          .steps = 40,
                          .weights = {.depth = weight},
                          .samples_per_ray = 16,
                          .tolerance = 0.0,
                          .head = known})
            .losses;
    };
    const Tensor depths = face.depths_of(face.model);
    HeadDepth target(&head(), face.faces);
    target.align(0, face.camera, depths);
    const double expected =
        mean_distance(depth_differences(depths, *target.surface(0, face.camera, depths.shape(0)))) /
        eye_distance(head(), vertices_of_batch());
    const std::vector<double> drawn = losses(&head(), 3.0);
    CHECK(drawn.front() - losses(nullptr, 3.0).front() == Approx(3.0 * expected).epsilon(1e-4));
    CHECK(losses(&head(), 0.0).front() == losses(nullptr, 3.0).front());
    CHECK(drawn.back() < drawn.front());
}

namespace {

/// Mean distance between the depth of the face after tuning and that of its head, seen by `camera`.
double depth_error(const RenderedFace& face, const Camera& camera, const TuningOptions& options) {
    Model tuned = tiny_model(1);
    static_cast<void>(
        tune_decoder(face.model, tuned, face.loss, face.faces, face.codes, {face.camera}, options));
    HeadDepth target(&head(), face.faces);
    target.align(0, face.camera, face.depths_of(face.model));
    const Tensor depths =
        render_view(tuned, face.codes, 0, camera, {.samples_per_ray = 16, .depth = true}).depth;
    return mean_distance(depth_differences(depths, *target.surface(0, camera, depths.shape(0))));
}

}  // namespace

TEST_CASE("Tuning brings the depth of a face to that of its head", "[head_depth]") {
    const RenderedFace face;
    const auto error = [&](double weight) {
        return depth_error(face, face.camera,
                           {.steps = 120,
                            .learning_rate = 0.2,
                            .weights = {.depth = weight, .mask = 0.05},
                            .head = &head(),
                            .samples_per_ray = 16});
    };
    const double without = error(0.0);
    CHECK(error(3.0) < 0.5 * without);
}

TEST_CASE("Anchors that show the face from other sides have the depth of its head",
          "[head_depth]") {
    const RenderedFace face;
    const Camera side_camera = model_camera(face.model, 0.4, 0.0, 0.0);
    const auto error = [&](double locality) {
        return depth_error(face, side_camera,
                           {.steps = 240,
                            .learning_rate = 0.2,
                            .weights = {.locality = locality, .depth = 3.0, .mask = 0.05},
                            .head = &head(),
                            .samples_per_ray = 16});
    };
    // Without the locality term there are no anchors.
    CHECK(error(1.0) < 0.75 * error(0.0));
}

TEST_CASE("Tuning draws depth at the side that is rendered, whatever the photo's", "[head_depth]") {
    ModelConfig config = tiny_model_config();
    config.decoder.conditioning = "concatenation";
    config.decoder.render = "none";
    config.decoder.resolution = 32;
    config.reconstruction.resolution_weights = {1.0, 1.0};
    const auto made = [&] {
        Rng rng(1);
        Model model(config, rng);
        model.parameters().set_trainable("", false);
        return model;
    };
    const Model model = made();
    const ReconstructionLoss loss(config.reconstruction);
    const Camera camera = model_camera(model, 0.0, 0.0, 0.0);
    const Codes codes = random_codes(1, 7);
    FaceBatch faces = batch_of(camera);
    faces.targets = {
        model.decoder()(codes, {camera}, {.samples_per_ray = 4}).images.front().value()};
    REQUIRE(faces.targets.front().shape(1) == 16);
    Model tuned = made();
    const TuningResult result = tune_decoder(model, tuned, loss, faces, codes, {camera},
                                             {.steps = 4, .head = &head(), .samples_per_ray = 4});
    CHECK(std::isfinite(result.losses.back()));
}

}  // namespace head_depth_tests
