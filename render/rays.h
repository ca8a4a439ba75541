#pragma once

#include <vector>

#include "core/rng.h"
#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// Which planes bound the samples.
enum class DepthPlanes {
    world_z,  ///< world planes z = near_z and z = far_z, as in HeadNeRF; rays must not be nearly
              ///< parallel to them
    optical_axis,  ///< depth along the optical axis from |centre| - near_z to |centre| - far_z, for
                   ///< any yaw
};

struct RaySampling {
    std::int64_t rays_per_side = 32;
    std::int64_t samples_per_ray = 32;
    double near_z = 2.5;
    double far_z = -3.5;
    DepthPlanes planes = DepthPlanes::world_z;
    /// true: rays pass through the centres of pixels, (i + 0.5) / side; false: through their
    /// corners, as in HeadNeRF.
    bool pixel_centers = true;
};

/// A ray of a camera with the interval that is sampled, as distances from the camera's centre.
struct Ray {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< of length 1
    double near_distance = 0.0;
    double far_distance = 0.0;
};

/// Unit vector through one pixel of the feature map, along the camera's own axes: x right, y down,
/// z forward.
[[nodiscard]] Eigen::Vector3d camera_direction(const Intrinsics& intrinsics,
                                               const RaySampling& sampling, std::int64_t row,
                                               std::int64_t column);
/// The ray through one pixel of the feature map. Throws like `sample_rays`.
[[nodiscard]] Ray camera_ray(const Camera& camera, const RaySampling& sampling, std::int64_t row,
                             std::int64_t column);
/// Distance of sample k of N without jitter; k = N is the far plane.
[[nodiscard]] inline double sample_distance(const Ray& ray, std::int64_t k,
                                            std::int64_t samples_per_ray) {
    return ray.near_distance + (ray.far_distance - ray.near_distance) *
                                   (static_cast<double>(k) / static_cast<double>(samples_per_ray));
}

/// Samples of B cameras with R = rays_per_side^2 rays (row-major over the image) and N samples
/// each.
struct RaySamples {
    Tensor points;  ///< (B, R * N, 3), world coordinates
    Tensor deltas;  ///< (B, R, N), Euclidean distance to the next sample; the last one reaches the
                    ///< far plane
    Tensor depths;  ///< (B, R, N), Euclidean distance from the camera's centre
};

/// Number of random numbers that jitter draws for each ray.
[[nodiscard]] constexpr std::int64_t jitter_numbers(std::int64_t samples_per_ray) {
    return samples_per_ray + 1;
}

/// Samples the rays of cameras. N + 1 equidistant depths from the near to the far plane bound N
/// intervals; each sample is at the start of its interval. With `jitter` (training) each of the N +
/// 1 depths moves uniformly within its stratum, so the last interval may end before the far plane.
/// A near plane behind the camera is moved to the camera. Throws ValueError for fewer than two
/// samples, for planes in the wrong order, for a camera behind the far plane and for a ray within 3
/// degrees of parallel to the planes.
[[nodiscard]] RaySamples sample_rays(const std::vector<Camera>& cameras,
                                     const RaySampling& sampling, Rng* jitter,
                                     DType dtype = DType::float32);

}  // namespace stymo
