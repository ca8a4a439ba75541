#include "nn/models/camera_problem.h"

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

}  // namespace stymo
