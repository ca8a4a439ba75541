#include "apps/view/depth_normals.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <vector>

#include "core/error.h"

namespace stymo {

Tensor depth_normals(const Tensor& depth, const Camera& camera, const RaySampling& sampling) {
    const std::int64_t side = sampling.rays_per_side;
    if (!(depth.shape() == Shape{side, side, 1}))
        fail<ShapeError>("[depth_normals] needs (", side, ", ", side, ", 1), got ", depth.shape());
    const std::vector<double> depths = depth.to_vector();
    std::vector<Eigen::Vector3d> points;
    points.reserve(depths.size());
    for (std::int64_t i = 0; i < side * side; ++i) {
        const Eigen::Vector3d direction =
            camera.world_from_camera *
            camera_direction(camera.intrinsics, sampling, i / side, i % side);
        points.emplace_back(camera.center + depths[static_cast<std::size_t>(i)] * direction);
    }
    const auto point = [&](std::int64_t row, std::int64_t column) -> const Eigen::Vector3d& {
        const std::int64_t y = std::clamp<std::int64_t>(row, 0, side - 1),
                           x = std::clamp<std::int64_t>(column, 0, side - 1);
        return points[static_cast<std::size_t>(y * side + x)];
    };
    Tensor result({side, side, 3});
    const std::span<float> values = result.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const std::int64_t row = i / side, column = i % side;
        const Eigen::Vector3d right = point(row, column + 1) - point(row, column - 1);
        const Eigen::Vector3d down = point(row + 1, column) - point(row - 1, column);
        const Eigen::Vector3d normal = down.cross(right).stableNormalized();
        for (int axis = 0; axis < 3; ++axis)
            values[static_cast<std::size_t>(3 * i + axis)] = static_cast<float>(normal[axis]);
    }
    return result;
}

}  // namespace stymo
