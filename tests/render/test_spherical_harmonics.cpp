#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/error.h"
#include "render/spherical_harmonics.h"

TEST_CASE("Spherical harmonics have the values and signs of the field's formula") {
    // numpy: n = (2, -3, 6) / 7 put into the table of constants with six decimals
    const std::array<double, 9> values =
        stymo::spherical_harmonics({2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0});
    const std::array<double, 9> expected{0.886227,
                                         -1.772454 * (-3.0 / 7.0),
                                         1.772454 * (6.0 / 7.0),
                                         -1.772454 * (2.0 / 7.0),
                                         2.427032 * (-6.0 / 49.0),
                                         -2.427032 * (-18.0 / 49.0),
                                         0.700624 * (108.0 / 49.0 - 1.0),
                                         -2.427032 * (12.0 / 49.0),
                                         1.213516 * (4.0 / 49.0 - 9.0 / 49.0)};
    for (std::size_t k = 0; k < 9; ++k) CHECK(values[k] == Approx(expected[k]).margin(2e-6));
}

TEST_CASE(
    "Spherical harmonics are orthogonal, with the squared weights of the Lambertian kernel as "
    "norms") {
    constexpr int polar_steps = 200;
    constexpr int around_steps = 200;
    using std::numbers::pi;
    std::array<std::array<double, 9>, 9> integral{};
    for (int i = 0; i < polar_steps; ++i) {
        const double z = -1.0 + (2.0 * i + 1.0) / polar_steps;
        for (int j = 0; j < around_steps; ++j) {
            const double angle = 2.0 * pi * j / around_steps;
            const double ring = std::sqrt(1.0 - z * z);
            const auto values =
                stymo::spherical_harmonics({ring * std::cos(angle), ring * std::sin(angle), z});
            for (std::size_t a = 0; a < 9; ++a) {
                for (std::size_t b = 0; b < 9; ++b)
                    integral[a][b] +=
                        values[a] * values[b] * 4.0 * pi / (polar_steps * around_steps);
            }
        }
    }
    for (std::size_t a = 0; a < 9; ++a) {
        const double norm = a == 0 ? pi * pi : a < 4 ? 4.0 * pi * pi / 3.0 : pi * pi / 2.0;
        for (std::size_t b = 0; b < 9; ++b)
            CHECK(integral[a][b] == Approx(a == b ? norm : 0.0).margin(2e-3));
    }
}

TEST_CASE("Light is function major and colour minor") {
    std::vector<float> light(27, 0.0F);
    light[0] = 1.0F;           // red, constant
    light[3 * 2 + 1] = -1.0F;  // green, from the front
    light[3 * 1 + 2] = 0.5F;   // blue, from above
    const Eigen::Vector3d facing = stymo::irradiance(light, {0.0, 0.0, -1.0});
    CHECK(facing[0] == Approx(0.886227).epsilon(1e-6));
    CHECK(facing[1] == Approx(1.772454).epsilon(1e-6));
    CHECK(facing[2] == Approx(0.0).margin(1e-12));
    CHECK(stymo::irradiance(light, {0.0, -1.0, 0.0})[2] == Approx(0.886227).epsilon(1e-6));
    CHECK_THROWS_AS(stymo::irradiance(std::vector<float>(9), {0.0, 0.0, 1.0}), stymo::ShapeError);
}

TEST_CASE("Neutral light is white and the same from everywhere") {
    const auto light = stymo::neutral_light();
    for (const Eigen::Vector3d& normal :
         {Eigen::Vector3d{1, 0, 0}, Eigen::Vector3d{0, 0.6, -0.8}}) {
        for (const double value : stymo::irradiance(light, normal))
            CHECK(value == Approx(0.8 * 0.886227).epsilon(1e-6));
    }
}
