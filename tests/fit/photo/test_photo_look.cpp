#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "fit/photo/photo_look.h"

namespace photo_look_tests {

using namespace stymo;

namespace {

constexpr std::int64_t side = 100;

/// The points that count: eyes at (35, 40) and (65, 40), brows, nose, mouth and chin below.
Landmarks landmarks() {
    Landmarks points;
    points.fill({50.0, 70.0});
    for (std::size_t k = 36; k < 42; ++k) points[k] = {35.0, 40.0};
    for (std::size_t k = 42; k < 48; ++k) points[k] = {65.0, 40.0};
    points[21] = {46.0, 32.0};
    points[22] = {54.0, 32.0};
    points[30] = {50.0, 55.0};
    points[31] = {45.0, 58.0};
    points[35] = {55.0, 58.0};
    points[8] = {50.0, 90.0};
    return points;
}

/// Skin with another colour in rows [first, last).
Tensor face(std::int64_t first, std::int64_t last, const std::array<float, 3>& color) {
    constexpr std::array<float, 3> skin{0.8F, 0.6F, 0.5F};
    Tensor image({side, side, 3});
    const auto values = image.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) {
        const auto row = static_cast<std::int64_t>(i) / (3 * side);
        values[i] = (row >= first && row < last ? color : skin)[i % 3];
    }
    return image;
}

}  // namespace

TEST_CASE("a cover is told by its colour, unless it is unknown", "[photo][unknown]") {
    const PhotoLook bare = look_of(face(0, 0, {}), landmarks());
    CHECK(bare.lower_face == 0.0);
    CHECK(bare.eyes == 0.0);
    CHECK(bare.brightness == Approx(1.9 / 3.0));
    const Tensor masked = face(60, 100, {0.69F, 0.84F, 0.91F});
    const PhotoLook mask = look_of(masked, landmarks());
    const double red = std::log(0.69 / 0.84) - std::log(0.8 / 0.6),
                 blue = std::log(0.91 / 0.84) - std::log(0.5 / 0.6),
                 light = 0.3 * std::log((0.69 + 0.84 + 0.91) / 1.9);
    CHECK(mask.lower_face ==
          Approx(std::sqrt(red * red + blue * blue + light * light)).epsilon(1e-5));
    CHECK(mask.eyes == 0.0);
    const PhotoLook glasses = look_of(face(36, 52, {0.05F, 0.05F, 0.05F}), landmarks());
    CHECK(glasses.eyes > 0.6);
    CHECK(glasses.lower_face == 0.0);
    Tensor known = Tensor::full({side, side, 1}, 1.0);
    std::ranges::fill(known.mutable_values<float>().subspan(60 * side), 0.0F);
    CHECK(look_of(masked, landmarks(), known).lower_face == 0.0);
    CHECK(look_of(masked, landmarks(), known).brightness == Approx(1.9 / 3.0));
}

TEST_CASE("colour differences do not depend on how bright a dark photo is", "[photo]") {
    Tensor dark = face(60, 100, {0.69F, 0.84F, 0.91F});
    for (float& value : dark.mutable_values<float>()) value *= 0.25F;
    CHECK(look_of(dark, landmarks()).lower_face ==
          Approx(look_of(face(60, 100, {0.69F, 0.84F, 0.91F}), landmarks()).lower_face)
              .epsilon(1e-4));
    CHECK(look_of(dark, landmarks()).brightness < 0.36);
}

}  // namespace photo_look_tests
