#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/angle.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/view.h"
#include "render/morphable/builtin_head.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

TEST_CASE("a view has what was asked for, in the sides of images and rays", "[view]") {
    const Model model = tiny_model();
    const Codes codes = random_codes(2, 1);
    const Camera camera = model_camera(model, 0.3, 0.1, 0.0);
    const View plain = render_view(model, codes, 0, camera, {.samples_per_ray = 4});
    CHECK(plain.image.shape() == Shape{16, 16, 3});
    CHECK_FALSE(plain.mask.defined());
    CHECK_FALSE(plain.depth.defined());

    const View full =
        render_view(model, codes, 0, camera,
                    {.samples_per_ray = 4, .resolution = 16, .mask = true, .depth = true});
    CHECK(identical(full.image, plain.image));
    CHECK(full.mask.shape() == Shape{16, 16, 1});
    CHECK(full.depth.shape() == Shape{8, 8, 1});
    for (const Tensor& tensor : {full.image, full.mask}) {
        for (const double value : tensor.to_vector()) {
            CHECK(value >= 0.0);
            CHECK(value <= 1.0);
        }
    }
    const RaySampling& rays = model.config().decoder.rays;
    for (const double depth : full.depth.to_vector()) {
        CHECK(depth > 5.3 - rays.near_z - 1.0);
        CHECK(depth < 2.0 * (5.3 - rays.far_z));
    }
}

TEST_CASE("a view shows the row of the codes that was asked for", "[view]") {
    const Model model = tiny_model();
    const Codes codes = random_codes(2, 1);
    const Camera camera = model_camera(model, 0.0, 0.0, 0.0);
    const Tensor first = render_view(model, codes, 0, camera, {.samples_per_ray = 4}).image;
    const Tensor second = render_view(model, codes, 1, camera, {.samples_per_ray = 4}).image;
    CHECK_FALSE(check_close(first, second, 1e-3).passed);
    const Decoded both = model.decoder()(codes, {camera, camera}, {.samples_per_ray = 4});
    const std::vector<double> images = both.images.back().value().to_vector();
    const std::vector<double> shown = second.to_vector();
    for (std::size_t i = 0; i < shown.size(); ++i)
        CHECK(shown[i] == Approx(0.5 * images[shown.size() + i] + 0.5).margin(1e-5));
}

TEST_CASE("the model's camera keeps the pivot in the middle of the image, at the model's distance",
          "[view]") {
    const Model model = tiny_model();
    const CameraConfig& camera = model.config().camera;
    for (const double yaw : {-0.7, 0.0, 0.4}) {
        const Eigen::Vector3d seen =
            project(model_camera(model, yaw, 0.2, 0.1), {0.0, 0.0, camera.pivot_depth});
        CHECK(seen[0] == Approx(camera.intrinsics.center_x));
        CHECK(seen[1] == Approx(camera.intrinsics.center_y));
        CHECK(seen[2] == Approx(camera.distance - camera.pivot_depth));
    }
    CHECK(model_camera(model, 0.0, 0.0, 0.0).center[2] == Approx(camera.distance));
}

namespace {

/// The model with the weights whose names begin so multiplied by a factor.
Model with_scaled_weights(Model model, const std::string& prefix, double factor) {
    for (const Parameter& parameter : model.parameters().all())
        if (parameter.name().starts_with(prefix))
            parameter.set_value((parameter.variable() * factor).value());
    return model;
}

std::string refusal_of(const Model& model, RenderMode mode, const Codes& codes) {
    return error_message<NumericError>([&] {
        FaceRenderer renderer(model, {.mode = mode, .samples_per_ray = 8, .tolerance = 0.01});
        renderer.show(codes);
        static_cast<void>(renderer.render(model_camera(model, 0.1, 0.0, 0.0)));
    });
}

}  // namespace

TEST_CASE("A frame that overflows is refused in every mode, not shown as black", "[view]") {
    const Codes codes = random_codes(1, 1);
    const Codes huge = random_codes(1, 1, 1e39);
    const Model sound = tiny_model();
    for (const RenderModeTraits& traits : render_modes()) {
        const RenderMode mode = traits.mode;
        INFO(name_of(mode));
        CHECK(refusal_of(sound, mode, codes).empty());
        for (const double factor : {1e25, -1e25}) {
            INFO("weights times " << factor);
            const std::string said = refusal_of(
                with_scaled_weights(tiny_model(), "decoder.block16", factor), mode, codes);
            CHECK_THAT(said, Catch::Contains("not finite"));
            CHECK(is_one_line(said));
        }
        CHECK_THAT(refusal_of(sound, mode, huge), Catch::Contains("not finite"));
        Codes shape = codes;
        shape.groups[0] = huge.groups[0];  // reaches the density alone
        CHECK_THAT(refusal_of(sound, mode, shape), Catch::Contains("not finite"));
    }
    CHECK_THROWS_AS(decoded_view(sound, huge, 0, model_camera(sound, 0.1, 0.0, 0.0), {}),
                    NumericError);
}

TEST_CASE("a head that turns by 45 degrees around its middle stays in the image", "[view]") {
    const CameraConfig camera;
    const MorphableHead head = builtin_head();
    const auto vertices = head.mean.values<float>();
    const auto outside = [&](double turning_z, double yaw) {
        const Camera turned = turned_camera(camera, turning_z, radians_from_degrees(yaw), 0.0, 0.0);
        std::int64_t count = 0;
        for (std::size_t v = 0; v < vertices.size(); v += 3) {
            const Eigen::Vector3d point =
                project(turned, Eigen::Vector3d(vertices[v], vertices[v + 1], vertices[v + 2]));
            count += point.x() < 0.0 || point.x() > 1.0 ? 1 : 0;
        }
        return count;
    };
    for (const double yaw : {-45.0, -30.0, 0.0, 15.0, 45.0}) CHECK(outside(head_middle, yaw) == 0);
    CHECK(outside(camera.pivot_depth, 45.0) > 0);

    const Eigen::Vector3d middle(0.0, 0.0, head_middle);
    const Camera near = turned_camera(camera, head_middle, 0.4, -0.1, 0.2, 0.8);
    CHECK(project(near, middle).head<2>().isApprox(Eigen::Vector2d(0.5, 0.5), 1e-9));
    CHECK((near.center - middle).norm() == Approx(0.8 * (camera.distance - head_middle)));
}

TEST_CASE("A face is shown from beyond its photo, if that is farther than usual", "[view]") {
    const CameraConfig camera;
    const auto distance_at = [&](double times) {
        return usual_distance(
            camera, pose_from_camera(turned_camera(camera, head_middle, 0.3, 0.1, 0.0, times)));
    };
    CHECK(distance_at(1.0) == whole_head_distance);
    CHECK(distance_at(whole_head_distance) == whole_head_distance);
    CHECK(distance_at(1.3) == Approx(1.43));
}
