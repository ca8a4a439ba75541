#include "render/tracked_rays.h"

#include "core/error.h"
#include "core/ops/ops.h"

namespace stymo {
namespace {

/// Where the samples stand relative to the camera, along its axes right, up and towards it: (B, R *
/// N, 3).
Tensor camera_points(const std::vector<Camera>& cameras, const RaySampling& sampling,
                     const Tensor& depths) {
    const std::int64_t rays = depths.shape(1), samples = depths.shape(2),
                       side = sampling.rays_per_side;
    std::vector<double> points;
    points.reserve(static_cast<std::size_t>(3 * depths.size()));
    const std::vector<double> distances = depths.to_vector();
    for (std::size_t i = 0; i < distances.size(); ++i) {
        const std::int64_t ray = static_cast<std::int64_t>(i) / samples;
        const Camera& camera = cameras[static_cast<std::size_t>(ray / rays)];
        const std::int64_t pixel = ray % rays;
        const Eigen::Vector3d direction =
            camera_direction(camera.intrinsics, sampling, pixel / side, pixel % side);
        points.insert(points.end(), {distances[i] * direction[0], -distances[i] * direction[1],
                                     -distances[i] * direction[2]});
    }
    return Tensor::from({depths.shape(0), rays * samples, 3}, std::span<const double>(points))
        .to(depths.dtype());
}

/// rotation_from_angles, (B, 3, 3), of orbit parameters (B, 6).
Variable rotations(const Variable& orbits) {
    const auto angle = [&](std::int64_t index) { return slice(orbits, 1, index, index + 1); };
    const Variable cos_yaw = cos(angle(0)), sin_yaw = sin(angle(0));
    const Variable cos_pitch = cos(angle(1)), sin_pitch = sin(angle(1));
    const Variable cos_roll = cos(angle(2)), sin_roll = sin(angle(2));
    const Variable entries =
        concat({cos_roll * cos_yaw, cos_roll * sin_yaw * sin_pitch - sin_roll * cos_pitch,
                cos_roll * sin_yaw * cos_pitch + sin_roll * sin_pitch, sin_roll * cos_yaw,
                sin_roll * sin_yaw * sin_pitch + cos_roll * cos_pitch,
                sin_roll * sin_yaw * cos_pitch - cos_roll * sin_pitch, sin_yaw * -1.0,
                cos_yaw * sin_pitch, cos_yaw * cos_pitch},
               1);
    return reshape(entries, {orbits.shape(0), 3, 3});
}

}  // namespace

Tensor orbit_parameters(std::span<const Pose> poses, DType dtype) {
    std::vector<double> values;
    for (const Pose& pose : poses) {
        const Eigen::Vector3d center =
            rotation_from_angles(pose.yaw, pose.pitch, pose.roll).transpose() * pose.translation;
        values.insert(values.end(),
                      {pose.yaw, pose.pitch, pose.roll, center[0], center[1], center[2]});
    }
    return Tensor::from({std::ssize(poses), 6}, std::span<const double>(values)).to(dtype);
}

Tensor orbit_parameters(std::span<const Camera> cameras, DType dtype) {
    std::vector<Pose> poses;
    for (const Camera& camera : cameras) poses.push_back(pose_from_camera(camera));
    return orbit_parameters(poses, dtype);
}

std::vector<Camera> cameras_at(const Tensor& parameters, std::vector<Camera> cameras) {
    for (std::size_t i = 0; i < cameras.size(); ++i)
        cameras[i] = camera_from_pose(pose_from_orbit(parameters, static_cast<std::int64_t>(i)),
                                      cameras[i].intrinsics);
    return cameras;
}

Pose pose_from_orbit(const Tensor& parameters, std::int64_t index) {
    const std::vector<double> all = parameters.to_vector();
    const double* const row = &all[static_cast<std::size_t>(6 * index)];
    const Eigen::Vector3d center(row[3], row[4], row[5]);
    return {row[0], row[1], row[2], rotation_from_angles(row[0], row[1], row[2]) * center};
}

Variable tracked_points(const Variable& orbits, const std::vector<Camera>& cameras,
                        const RaySampling& sampling, const Tensor& depths) {
    const std::int64_t batch = std::ssize(cameras),
                       rays = sampling.rays_per_side * sampling.rays_per_side;
    if (!(orbits.shape() == Shape{batch, 6}) || depths.rank() != 3 || depths.shape(0) != batch ||
        depths.shape(1) != rays)
        fail<ShapeError>("[tracked_points] orbits ", orbits.shape(), " and depths ", depths.shape(),
                         " do not fit ", batch, " cameras with ", rays, " rays");
    const Variable centers = reshape(slice(orbits, 1, 3, 6), {batch, 1, 3});
    const Variable relative = Variable(camera_points(cameras, sampling, depths)) + centers;
    return matmul(relative, rotations(orbits), {.transpose_b = true});
}

}  // namespace stymo
