#include "nn/realtime/trained_volume.h"

#include <algorithm>
#include <cmath>

namespace stymo {

SampleRange samples_in_trained_volume(const CameraConfig& trained, const Camera& camera,
                                      const Ray& ray, std::int64_t samples_per_ray) {
    constexpr double room = 1.25;
    const double slope = 0.5 * room / trained.intrinsics.focal,
                 height = trained.distance - trained.pivot_depth;
    const Eigen::Vector3d from_pivot = ray.origin - Eigen::Vector3d(0.0, 0.0, trained.pivot_depth);
    const Eigen::Vector3d start = camera.world_from_camera.transpose() * from_pivot,
                          step = camera.world_from_camera.transpose() * ray.direction;
    // At distance t on the ray, each side of the volume bounds by offset + t * rate <= 0. The side
    // towards the optical axis moves with it, so that cameras that turn around the head's origin
    // instead of the pivot see their whole image.
    double nearest = ray.near_distance, farthest = ray.far_distance;
    for (const Eigen::Index axis : {0, 1}) {
        for (const double side : {-1.0, 1.0}) {
            const double shift = std::clamp(side * start[axis], 0.0, trained.pivot_depth);
            const double offset = side * start[axis] - shift - slope * (height + start[2]);
            const double rate = side * step[axis] - slope * step[2];
            if (rate > 0.0) {
                farthest = std::min(farthest, -offset / rate);
            } else if (rate < 0.0) {
                nearest = std::max(nearest, -offset / rate);
            } else if (offset > 0.0) {
                return {};
            }
        }
    }
    const double samples = static_cast<double>(samples_per_ray),
                 per_unit = samples / (ray.far_distance - ray.near_distance);
    const auto count_below = [&](double distance) {
        return std::clamp((distance - ray.near_distance) * per_unit, 0.0, samples);
    };
    const double first = std::ceil(count_below(nearest)), end = std::ceil(count_below(farthest));
    if (!(first < end)) return {};
    return {static_cast<std::int32_t>(first), static_cast<std::int32_t>(end)};
}

}  // namespace stymo
