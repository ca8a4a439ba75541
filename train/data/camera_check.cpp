#include "train/data/camera_check.h"

#include "core/error.h"
#include "render/rays.h"

namespace stymo {

std::optional<std::string> camera_problem(const DecoderConfig& config, const Camera& camera) {
    RaySampling sampling = config.rays;
    sampling.planes =
        config.depth_planes == "optical_axis" ? DepthPlanes::optical_axis : DepthPlanes::world_z;
    if (config.render == "none") sampling.rays_per_side = config.resolution;
    const std::int64_t last = sampling.rays_per_side - 1;
    try {
        // The directions for which a plane can be rendered form a cone. It contains all rays if it
        // contains the rays of the corners.
        for (const std::int64_t row : {std::int64_t{0}, last})
            for (const std::int64_t column : {std::int64_t{0}, last})
                static_cast<void>(camera_ray(camera, sampling, row, column));
        return std::nullopt;
    } catch (const ValueError& error) {
        return error.what();
    }
}

CameraCheck camera_check(const DecoderConfig& config, bool with_mirror) {
    return [config, with_mirror](const Pose& pose, const Intrinsics& intrinsics) {
        auto problem = camera_problem(config, camera_from_pose(pose, intrinsics));
        if (problem || !with_mirror) return problem;
        Intrinsics flipped = intrinsics;
        flipped.center_x = 1.0 - intrinsics.center_x;
        return camera_problem(config, camera_from_pose(mirrored(pose), flipped));
    };
}

}  // namespace stymo
