#include "render/morphable/shading.h"

#include <algorithm>

#include "render/spherical_harmonics.h"

namespace stymo {

Tensor shaded_colors(const Tensor& albedo, const Tensor& normals, std::span<const float> light,
                     const Camera& camera) {
    Tensor colors = albedo;
    const auto normal_values = normals.values<float>();
    const auto color_values = colors.mutable_values<float>();
    const Eigen::Matrix3d camera_from_world = camera.world_from_camera.transpose();
    for (std::size_t vertex = 0; vertex < color_values.size(); vertex += 3) {
        const Eigen::Vector3d normal =
            camera_from_world *
            Eigen::Map<const Eigen::Vector3f>(&normal_values[vertex]).cast<double>();
        const Eigen::Vector3d received = irradiance(light, normal);
        for (std::size_t channel = 0; channel < 3; ++channel) {
            color_values[vertex + channel] =
                std::clamp(color_values[vertex + channel] *
                               static_cast<float>(received[static_cast<Eigen::Index>(channel)]),
                           0.01F, 1.0F);
        }
    }
    return colors;
}

}  // namespace stymo
