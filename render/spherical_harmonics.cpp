#include "render/spherical_harmonics.h"

#include <cmath>
#include <numbers>

#include "core/error.h"

namespace stymo {

std::array<double, 9> spherical_harmonics(const Vector3& normal) {
    using std::numbers::pi;
    const auto [x, y, z] = normal;
    // The kernel's weights pi, 2 pi / sqrt(3), 2 pi / sqrt(8) times the normalisation of the harmonics of bands 0, 1, 2.
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

Vector3 irradiance(std::span<const float> light, const Vector3& normal) {
    if (light.size() != 27) fail<ShapeError>("[irradiance] needs 27 coefficients; got ", light.size());
    const std::array<double, 9> harmonics = spherical_harmonics(normal);
    Vector3 result{};
    for (std::size_t k = 0; k < harmonics.size(); ++k) {
        for (std::size_t channel = 0; channel < 3; ++channel)
            result[channel] += static_cast<double>(light[3 * k + channel]) * harmonics[k];
    }
    return result;
}

std::array<float, 27> neutral_light() {
    std::array<float, 27> light{};
    light[0] = light[1] = light[2] = 0.8F;
    return light;
}

}  // namespace stymo
