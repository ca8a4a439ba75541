#include "render/spherical_harmonics.h"

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

}  // namespace stymo
