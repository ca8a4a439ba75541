#include "render/depth_map.h"

#include <algorithm>
#include <array>

namespace stymo {

Eigen::Vector3d direction_at(const Intrinsics& intrinsics, const Eigen::Vector2d& image_point) {
    return Eigen::Vector3d((image_point[0] - intrinsics.center_x) / intrinsics.focal,
                           (image_point[1] - intrinsics.center_y) / intrinsics.focal, 1.0)
        .normalized();
}

double depth_at(const Tensor& depths, const Eigen::Vector2d& image_point) {
    const std::int64_t side = depths.shape(0);
    std::array<std::int64_t, 2> first{};
    std::array<double, 2> part{};
    for (int axis = 0; axis < 2; ++axis) {
        const double position = std::clamp(image_point[axis] * static_cast<double>(side) - 0.5, 0.0,
                                           static_cast<double>(side - 1));
        const auto index = static_cast<std::size_t>(axis);
        first[index] = std::min(static_cast<std::int64_t>(position), side - 2);
        part[index] = position - static_cast<double>(first[index]);
    }
    const auto depth = [&](std::int64_t row, std::int64_t column) {
        return static_cast<double>(depths.values<float>()[static_cast<std::size_t>(
            (first[1] + row) * side + first[0] + column)]);
    };
    double sum = 0.0;
    for (const std::int64_t row : {0, 1})
        for (const std::int64_t column : {0, 1}) {
            const double weight =
                (row == 1 ? part[1] : 1.0 - part[1]) * (column == 1 ? part[0] : 1.0 - part[0]);
            // 0 times an infinite depth would be NaN.
            if (weight > 0.0) sum += weight * depth(row, column);
        }
    return sum;
}

Eigen::Vector3d point_at(const Camera& camera, const Tensor& depths,
                         const Eigen::Vector2d& image_point) {
    return camera.center +
           depth_at(depths, image_point) *
               (camera.world_from_camera * direction_at(camera.intrinsics, image_point));
}

}  // namespace stymo
