#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/metrics.h"
#include "nn/engine/softplus.h"
#include "nn/realtime/baked_field.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/sampled_field.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

FoldedField tiny_field(const Model& model, std::uint64_t seed = 1) {
    return model.decoder().folded_field(detached(model.decoder().map(random_codes(1, seed))));
}

/// The field with `scale` times its densities' inputs, `offset` more.
FoldedField with_density(FoldedField field, float scale, float offset) {
    for (float& weight : field.density.weight.mutable_values<float>()) weight *= scale;
    for (float& bias : field.density.bias.mutable_values<float>()) bias = bias * scale + offset;
    return field;
}

RaySampling sampling_of(const Model& model, std::int64_t samples) {
    RaySampling sampling = model.config().decoder.rays;
    sampling.samples_per_ray = samples;
    return sampling;
}

CameraRays rays_of(const Camera& camera, const RaySampling& sampling) {
    CameraRays rays{{}, sampling.samples_per_ray};
    for (std::int64_t row = 0; row < sampling.rays_per_side; ++row) {
        for (std::int64_t column = 0; column < sampling.rays_per_side; ++column)
            rays.rays.push_back(camera_ray(camera, sampling, row, column));
    }
    return rays;
}

FeatureMap seen(FieldSource& source, const CameraRays& rays) {
    FeatureMap map;
    source.render(rays, map, {});
    return map;
}

double relative_error(const std::vector<float>& values, const std::vector<float>& expected) {
    double difference = 0.0, size = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        difference += std::pow(static_cast<double>(values[i] - expected[i]), 2);
        size += std::pow(static_cast<double>(expected[i]), 2);
    }
    return std::sqrt(difference / size);
}

}  // namespace

TEST_CASE("a baked field comes closer to the exact one with its resolution", "[baked]") {
    const Model model = tiny_model();
    const RaySampling sampling = sampling_of(model, 16);
    // A body with an inside and an outside: most of an untrained field is fog.
    const FoldedField field = with_density(tiny_field(model), 20.0F, -6.0F);
    RendererOptions options;
    options.mode = RenderMode::exact;
    options.samples_per_ray = sampling.samples_per_ray;
    const auto exact = make_sampled_field(model.config(), options);
    exact->set_field(field);
    const CameraRays rays = rays_of(model_camera(model, 0.3, 0.1, 0.0), sampling);
    const FeatureMap expected = seen(*exact, rays);

    std::vector<double> errors;
    for (const std::int64_t resolution : {16, 32, 64}) {
        BakedField baked(sampling, ViewRange{}, {.resolution = resolution, .tolerance = 1e-4});
        baked.set_field(field);
        const FeatureMap map = seen(baked, rays);
        errors.push_back(relative_error(map.features, expected.features));
        CHECK(map.field_samples == 0);
        CHECK(relative_error(map.depths, expected.depths) < 2.0 * errors.back());
    }
    INFO("errors " << errors[0] << ", " << errors[1] << ", " << errors[2]);
    CHECK(errors[1] < 0.5 * errors[0]);
    CHECK(errors[2] < 0.5 * errors[1]);
    CHECK(errors[2] < 0.04);
}

TEST_CASE("a baked field holds no more than was announced, even where everything shows",
          "[baked]") {
    const Model model = tiny_model();
    const RaySampling sampling = sampling_of(model, 8);
    for (const std::int64_t resolution : {8, 17, 32}) {
        const BakeOptions options{.resolution = resolution, .dimension = 8, .tolerance = 1e-6};
        const BakedSamples samples =
            bake(with_density(tiny_field(model), 0.0F, -2.0F), sampling, ViewRange{}, options);
        CHECK(samples.bytes() <= baked_bytes(options));
        CHECK(static_cast<std::int64_t>(samples.records.size()) >
              samples.grid.size() / 2 * samples.dimension);
    }
    CHECK(baked_bytes({.resolution = 128}) <= most_baked_bytes);
    CHECK_THROWS_AS(bake(tiny_field(model), sampling, ViewRange{}, {.resolution = 1000}),
                    ValueError);
    CHECK_THROWS_AS(bake(tiny_field(model), sampling, ViewRange{}, {.resolution = 4}), ValueError);
    CHECK_THROWS_AS(bake(tiny_field(model), sampling, ViewRange{}, {.dimension = 0}), ValueError);
}

TEST_CASE("an empty field bakes to nothing, and every ray sees the background", "[baked]") {
    const Model model = tiny_model();
    const RaySampling sampling = sampling_of(model, 8);
    BakedField baked(sampling, ViewRange{}, {.resolution = 16});
    baked.set_field(with_density(tiny_field(model), 0.0F, -40.0F));
    const CameraRays rays = rays_of(model_camera(model, 0.0, 0.0, 0.0), sampling);
    const FeatureMap map = seen(baked, rays);
    CHECK(std::ranges::all_of(map.occupied, [](std::uint8_t occupied) { return occupied == 0; }));
    CHECK(std::ranges::all_of(map.features, [](float value) { return value == 0.0F; }));
    for (const float depth : map.depths)
        CHECK(static_cast<double>(depth) == Approx(farthest_sample(rays)));
}

TEST_CASE("a camera within the head or beside it sees finite features", "[baked]") {
    const Model model = tiny_model();
    RaySampling sampling = sampling_of(model, 16);
    sampling.planes = DepthPlanes::optical_axis;
    sampling.near_z = 2.0;
    sampling.far_z = -2.0;
    const FoldedField field = with_density(tiny_field(model), 50.0F, 10.0F);
    BakedField baked(sampling, ViewRange{}, {.resolution = 32});
    baked.set_field(field);
    Camera camera = model_camera(model, 0.4, 0.0, 0.0);
    for (const double distance : {0.0, 0.5, 1.9, 100.0}) {
        camera.center = -distance * camera.world_from_camera.col(2);
        const FeatureMap map = seen(baked, rays_of(camera, sampling));
        CHECK(std::ranges::all_of(map.features, [](float value) {
            return std::isfinite(value) && std::abs(value) < 100.0F;
        }));
        CHECK(std::ranges::all_of(
            map.depths, [](float value) { return std::isfinite(value) && value >= 0.0F; }));
    }
}

TEST_CASE("the renderer's baked images are near the exact ones, from face to face", "[baked]") {
    const Model model = tiny_model();
    const Codes codes = random_codes(2, 3);
    RendererOptions options;
    options.mode = RenderMode::baked;
    options.samples_per_ray = 16;
    options.bake_resolution = 48;
    FaceRenderer renderer(model, options);
    for (const std::int64_t face : {0, 1}) {
        renderer.show(codes, face);
        for (const double yaw : {-0.3, 0.2}) {
            const Camera camera = model_camera(model, yaw, 0.1, 0.0);
            const View exact = decoded_view(model, codes, face, camera, {.samples_per_ray = 16});
            CHECK(peak_signal_to_noise_ratio(renderer.render(camera).image, exact.image) > 40.0);
        }
    }
}

TEST_CASE("softplus and its inverse cancel over the whole range of densities", "[baked]") {
    for (const float input : {-50.0F, -10.0F, -1.0F, 0.0F, 3.0F, 15.0F, 25.0F, 1000.0F})
        CHECK(inverse_softplus(softplus(input)) == Approx(input).epsilon(1e-5).margin(1e-6));
    CHECK(inverse_softplus(0.0F) == -60.0F);
}
