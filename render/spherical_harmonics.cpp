#include "render/spherical_harmonics.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.h"

namespace stymo {

std::array<double, 9> spherical_harmonics(const Eigen::Vector3d& normal) {
    using std::numbers::pi;
    const double x = normal.x(), y = normal.y(), z = normal.z();
    // The kernel's weights pi, 2 pi / sqrt(3), 2 pi / sqrt(8) times the normalisation of the
    // harmonics of bands 0, 1, 2.
    const double band0 = pi / std::sqrt(4.0 * pi);
    const double band1 = 2.0 * pi / std::sqrt(3.0) * std::sqrt(3.0 / (4.0 * pi));
    const double band2 = 2.0 * pi / std::sqrt(8.0) * 3.0 * std::sqrt(5.0 / (12.0 * pi));
    return {band0,
            -band1 * y,
            band1 * z,
            -band1 * x,
            band2 * x * y,
            -band2 * y * z,
            band2 / (2.0 * std::sqrt(3.0)) * (3.0 * z * z - 1.0),
            -band2 * x * z,
            0.5 * band2 * (x * x - y * y)};
}

Eigen::Vector3d irradiance(std::span<const float> light, const Eigen::Vector3d& normal) {
    if (light.size() != 27)
        fail<ShapeError>("[irradiance] needs 27 coefficients; got ", light.size());
    const std::array<double, 9> harmonics = spherical_harmonics(normal);
    const Eigen::Map<const Eigen::Matrix<float, 3, 9>> coefficients(light.data());
    return coefficients.cast<double>() *
           Eigen::Map<const Eigen::Vector<double, 9>>(harmonics.data());
}

std::array<float, 27> neutral_light() {
    std::array<float, 27> light{};
    light[0] = light[1] = light[2] = 0.8F;
    return light;
}

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
