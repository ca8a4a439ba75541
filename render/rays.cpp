#include "render/rays.h"

#include <algorithm>
#include <span>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {
namespace {

/// Depth k of `samples` + 1, moved at random within its stratum, which extends to the middles of
/// the two neighbouring intervals.
double stratified_position(std::int64_t k, std::int64_t samples, double uniform) {
    const double lower = std::max(static_cast<double>(k) - 0.5, 0.0);
    const double upper = std::min(static_cast<double>(k) + 0.5, static_cast<double>(samples));
    return (lower + (upper - lower) * uniform) / static_cast<double>(samples);
}

/// `uniforms` has samples + 1 numbers in [0, 1); if empty, depths are equidistant.
template <class T>
void sample_ray(const Ray& ray, std::span<const double> uniforms, std::span<T> points,
                std::span<T> deltas, std::span<T> depths) {
    const auto samples = static_cast<std::int64_t>(depths.size());
    const auto distance = [&](std::int64_t k) {
        if (uniforms.empty()) return sample_distance(ray, k, samples);
        const double position =
            stratified_position(k, samples, uniforms[static_cast<std::size_t>(k)]);
        return ray.near_distance + (ray.far_distance - ray.near_distance) * position;
    };
    double start = distance(0);
    for (std::int64_t k = 0; k < samples; ++k) {
        const double next = distance(k + 1);
        const auto index = static_cast<std::size_t>(k);
        depths[index] = static_cast<T>(start);
        deltas[index] = static_cast<T>(next - start);
        Eigen::Map<Eigen::Vector3<T>>{&points[3 * index]} =
            (ray.origin + start * ray.direction).cast<T>();
        start = next;
    }
}

void require_valid(const std::vector<Camera>& cameras, const RaySampling& sampling) {
    if (cameras.empty()) fail<ValueError>("[sample_rays] no camera given");
    if (sampling.rays_per_side < 1)
        fail<ValueError>("[sample_rays] rays_per_side must be at least 1, got ",
                         sampling.rays_per_side);
    if (sampling.samples_per_ray < 2)
        fail<ValueError>("[sample_rays] samples_per_ray must be at least 2, got ",
                         sampling.samples_per_ray);
    if (!(sampling.near_z > sampling.far_z))
        fail<ValueError>("[sample_rays] near_z must be larger than far_z, got ", sampling.near_z,
                         " and ", sampling.far_z);
}

}  // namespace

Eigen::Vector3d camera_direction(const Intrinsics& intrinsics, const RaySampling& sampling,
                                 std::int64_t row, std::int64_t column) {
    const double offset = sampling.pixel_centers ? 0.5 : 0.0;
    const auto side = static_cast<double>(sampling.rays_per_side);
    const double image_x = (static_cast<double>(column) + offset) / side;
    const double image_y = (static_cast<double>(row) + offset) / side;
    return Eigen::Vector3d((image_x - intrinsics.center_x) / intrinsics.focal,
                           (image_y - intrinsics.center_y) / intrinsics.focal, 1.0)
        .normalized();
}

Ray camera_ray(const Camera& camera, const RaySampling& sampling, std::int64_t row,
               std::int64_t column) {
    const Eigen::Vector3d direction =
        camera.world_from_camera * camera_direction(camera.intrinsics, sampling, row, column);

    const bool along_world_z = sampling.planes == DepthPlanes::world_z;
    const double height = along_world_z ? camera.center.z() : camera.center.norm();
    const double descent =
        along_world_z ? -direction.z() : direction.dot(camera.world_from_camera.col(2));
    // Within 3 degrees of the planes the samples lie more than a hundred units apart and miss the
    // head.
    constexpr double least_descent = 0.05;
    if (descent < least_descent) {
        fail<ValueError>(
            "[sample_rays] ray (row ", row, ", column ", column,
            ") runs along the planes z = ", sampling.near_z, " and z = ", sampling.far_z, "; use ",
            along_world_z ? "planes along the optical axis for a camera this far to the side"
                          : "a longer focal length");
    }
    if (height <= sampling.far_z)
        fail<ValueError>("[sample_rays] the camera stands behind the far plane z = ",
                         sampling.far_z);
    // A near plane behind the camera would put samples where the camera cannot see.
    const double near_depth = std::max(height - sampling.near_z, 0.0);
    return {camera.center, direction, near_depth / descent, (height - sampling.far_z) / descent};
}

RaySamples sample_rays(const std::vector<Camera>& cameras, const RaySampling& sampling, Rng* jitter,
                       DType dtype) {
    require_valid(cameras, sampling);
    const auto camera_count = static_cast<std::int64_t>(cameras.size());
    const std::int64_t side = sampling.rays_per_side, rays = side * side,
                       samples = sampling.samples_per_ray;

    // Drawn before the threads start, so that the numbers do not depend on the threads.
    const Tensor uniforms = jitter == nullptr
                                ? Tensor()
                                : jitter->uniform({camera_count, rays, jitter_numbers(samples)},
                                                  0.0, 1.0, DType::float64);
    RaySamples result{Tensor({camera_count, rays * samples, 3}, dtype),
                      Tensor({camera_count, rays, samples}, dtype),
                      Tensor({camera_count, rays, samples}, dtype)};
    dispatch(dtype, [&]<class T>(T) {
        const auto points = result.points.mutable_values<T>();
        const auto deltas = result.deltas.mutable_values<T>();
        const auto depths = result.depths.mutable_values<T>();
        const auto all_uniforms =
            uniforms.defined() ? uniforms.values<double>() : std::span<const double>();
        constexpr std::int64_t rays_per_chunk = 64;
        parallel_for(
            camera_count * rays, rays_per_chunk, [&](std::int64_t begin, std::int64_t end) {
                const auto count = static_cast<std::size_t>(samples);
                for (std::int64_t i = begin; i < end; ++i) {
                    const std::int64_t pixel = i % rays;
                    const Ray ray = camera_ray(cameras[static_cast<std::size_t>(i / rays)],
                                               sampling, pixel / side, pixel % side);
                    const auto index = static_cast<std::size_t>(i);
                    const auto ray_uniforms =
                        all_uniforms.empty() ? all_uniforms
                                             : all_uniforms.subspan(index * (count + 1), count + 1);
                    sample_ray<T>(ray, ray_uniforms, points.subspan(index * count * 3, count * 3),
                                  deltas.subspan(index * count, count),
                                  depths.subspan(index * count, count));
                }
            });
    });
    return result;
}

}  // namespace stymo
