#include "render/camera.h"

#include <cmath>
#include <numbers>

#include "cases/stability/case.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "core/tensor_eigen.h"
#include "nn/models/decoder.h"
#include "render/rays.h"

namespace stymo::stability {

namespace {

constexpr double right_angle = std::numbers::pi / 2.0;

RaySampling small_sampling(DepthPlanes planes) {
    return {.rays_per_side = 4, .samples_per_ray = 8, .planes = planes};
}

Camera camera_at(const Eigen::Vector3d& center, double yaw, double pitch) {
    return camera_from_pose({yaw, pitch, 0.0, center}, {});
}
Camera orbit_camera(double yaw, double pitch) {
    return camera_from_pose(orbit_pose(yaw, pitch, 0.0, 5.3), {});
}

std::function<StabilityResult(DType)> samples_of(const Camera& camera,
                                                 const RaySampling& sampling) {
    return [=](DType dtype) {
        const RaySamples rays = sample_rays({camera}, sampling, nullptr, dtype);
        return StabilityResult{.values = {rays.points, rays.deltas, rays.depths}};
    };
}

std::vector<StabilityCase> sampling_cases() {
    const RaySampling world = small_sampling(DepthPlanes::world_z),
                      optical = small_sampling(DepthPlanes::optical_axis);
    std::vector<StabilityCase> rows;
    const auto add = [&](const std::string& name, const std::string& behaviour,
                         const Camera& camera, const RaySampling& sampling) {
        rows.push_back({.name = name,
                        .behaviour = behaviour,
                        .value_bound = 1e-7,
                        .run = samples_of(camera, sampling)});
    };
    add("yaw 90, planes along the optical axis", "samples in float64, rounded once",
        orbit_camera(right_angle, 0.0), optical);
    add("yaw -90, planes along the optical axis", "the same", orbit_camera(-right_angle, 0.0),
        optical);
    add("pitch 90, planes along the optical axis", "the same", orbit_camera(0.0, right_angle),
        optical);
    add("pitch -90, planes along the optical axis", "the same", orbit_camera(0.0, -right_angle),
        optical);
    add("camera inside the head", "the near plane moves to the camera",
        camera_at({0.0, 0.0, 0.1}, 0.0, 0.0), world);
    add("camera in the head's origin, planes along the optical axis", "the same",
        camera_at({0.0, 0.0, 0.0}, 0.7, 0.2), optical);
    const std::string parallel = "refused, with the advice to take planes along the optical axis";
    rows.push_back(refused<ValueError>("a ray parallel to the planes", parallel, "ray (row ",
                                       samples_of(orbit_camera(right_angle, 0.0), world)));
    rows.push_back(refused<ValueError>("a camera behind the far plane", "refused", "far plane z",
                                       samples_of(camera_at({0.0, 0.0, -4.0}, 0.0, 0.0), world)));
    RaySampling swapped = world;
    std::swap(swapped.near_z, swapped.far_z);
    rows.push_back(refused<ValueError>("near and far plane exchanged",
                                       "refused: it would reverse the samples", "near_z",
                                       samples_of(orbit_camera(0.0, 0.0), swapped)));
    return rows;
}

/// The rotation, rounded to the type, and the rotation of the angles that are read out of it.
StabilityCase readout(const std::string& name, const std::string& behaviour, double bound,
                      double yaw, double pitch) {
    return {.name = name, .behaviour = behaviour, .value_bound = bound, .run = [=](DType dtype) {
                Eigen::Matrix3d rotation = rotation_from_angles(yaw, pitch, 0.3);
                if (dtype == DType::float32) rotation = rotation.cast<float>().cast<double>();
                const Eigen::Vector3d read = angles_from_rotation(rotation);
                const Eigen::Matrix3d again = rotation_from_angles(read[0], read[1], read[2]);
                return StabilityResult{.values = {tensor_from(again)}};
            }};
}

std::vector<StabilityCase> angle_cases() {
    const std::string lock =
        "gimbal lock: roll is read as 0, pitch takes its part; the rotation is the same";
    const std::string regular = "no lock: yaw is the middle angle";
    return {readout("angles read at yaw 90", lock, 1e-6, right_angle, 0.4),
            readout("angles read at yaw -90", lock, 1e-6, -right_angle, 0.4),
            readout("angles read at yaw 90 - 1e-5 rad", "just outside the lock", 1e-6,
                    right_angle - 1e-5, 0.4),
            readout("angles read at pitch 90", regular, 1e-6, 0.5, right_angle),
            readout("angles read at pitch -90", regular, 1e-6, 0.5, -right_angle)};
}

/// Images of a small decoder with fixed weights, and the gradient in the four codes.
StabilityResult decoded(DType dtype, double code_length, const Camera& camera,
                        const std::string& planes) {
    DecoderConfig config;
    config.resolution = 16;
    config.rays.rays_per_side = 8;
    config.field_width = 8;
    config.field_layers = 4;
    config.feature_channels = 8;
    config.frequencies = 4;
    config.block_channels = {6};
    config.mask_channels = 2;
    config.mapping_layers = 2;
    config.depth_planes = planes;
    ParameterStore store;
    Rng rng(1);
    const Decoder decoder(config, store, "decoder", rng);
    store.convert(dtype);
    std::vector<Tensor> codes;
    for (const std::int64_t size : code_sizes)
        codes.push_back(
            rng.normal({1, size}, 0.0, code_length / std::sqrt(static_cast<double>(size))));
    return differentiate(dtype, codes, [&](const std::vector<Variable>& z) {
        const Decoded image =
            decoder({{z[0], z[1], z[2], z[3]}}, {camera}, {.samples_per_ray = 8, .mask = true});
        return std::vector<Variable>{image.images.back(), image.mask_logit};
    });
}

std::vector<StabilityCase> decoder_cases() {
    const Camera frontal = orbit_camera(0.0, 0.0);
    std::vector<StabilityCase> rows;
    const auto add = [&](std::string name, std::string behaviour, double length,
                         const Camera& camera, const char* planes) {
        rows.push_back(
            {.name = std::move(name),
             .behaviour = std::move(behaviour),
             .value_bound = 1e-4,
             .gradient_bound = 1e-3,
             .run = [=](DType dtype) { return decoded(dtype, length, camera, planes); }});
    };
    add("decoder, codes of length 0", "a face like any other", 0.0, frontal, "world_z");
    add("decoder, codes of length 1e3", "demodulation takes the length out again", 1e3, frontal,
        "world_z");
    add("decoder, codes of length 1e6", "the same", 1e6, frontal, "world_z");
    add("decoder, camera inside the head", "the near plane moves to the camera", 10.0,
        camera_at({0.0, 0.0, 0.1}, 0.0, 0.0), "world_z");
    add("decoder, yaw 90", "planes along the optical axis", 10.0, orbit_camera(right_angle, 0.0),
        "optical_axis");
    add("decoder, pitch -90", "the same", 10.0, orbit_camera(0.0, -right_angle), "optical_axis");
    return rows;
}

}  // namespace

std::vector<StabilityCase> camera_cases() {
    return joined({sampling_cases(), angle_cases(), decoder_cases()});
}

}  // namespace stymo::stability
