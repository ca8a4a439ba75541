#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/rng.h"
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
    points[19] = {36.0, 30.0};
    points[24] = {64.0, 30.0};
    points[27] = {50.0, 40.0};
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

Tensor whole_mask() {
    return Tensor::full({side, side, 1}, 1.0);
}

/// The mask without rows [first, last) right of a column.
Tensor mask_without(std::int64_t first, std::int64_t last, std::int64_t column) {
    Tensor mask = whole_mask();
    for (std::int64_t i = first * side; i < last * side; ++i)
        if (i % side >= column) mask.mutable_values<float>()[static_cast<std::size_t>(i)] = 0.0F;
    return mask;
}

PhotoLook look(const Tensor& image, const Tensor& known = {}) {
    return look_of(image, whole_mask(), landmarks(), known);
}

}  // namespace

TEST_CASE("a cover counts where the pixels are known", "[photo][unknown]") {
    const FaceCovers covers{3.0, 4.0};
    const auto covers_of = [&](std::size_t first, std::size_t last) {
        Tensor known = whole_mask();
        std::ranges::fill(
            known.mutable_values<float>().subspan(first * side, (last - first) * side), 0.0F);
        return look_of(face(0, 0, {}), whole_mask(), landmarks(), known, covers).covers;
    };
    CHECK(covers_of(0, 0).mouth == covers.mouth);
    CHECK(covers_of(0, 0).eyes == covers.eyes);
    CHECK(covers_of(69, 71).mouth == 0.0);
    CHECK(covers_of(69, 71).eyes == covers.eyes);
    CHECK(covers_of(38, 40).eyes == 0.0);
}

TEST_CASE("the brightness of a photo is that of its known pixels", "[photo][unknown]") {
    const Tensor image = face(60, 100, {0.69F, 0.84F, 0.91F});
    CHECK(look(image).brightness == Approx(2.44 / 3.0));
    Tensor known = whole_mask();
    std::ranges::fill(known.mutable_values<float>().subspan(60 * side), 0.0F);
    CHECK(look(image, known).brightness == Approx(1.9 / 3.0));
}

TEST_CASE("a cover is told by a head mask that leaves it out", "[photo]") {
    const Tensor skin = face(0, 0, {});
    CHECK(look(skin).mouth_in_mask == 1.0);
    CHECK(look(skin).eyes_in_mask == 1.0);
    const PhotoLook mouth = look_of(skin, mask_without(60, 100, 0), landmarks());
    CHECK(mouth.mouth_in_mask == 0.0);
    CHECK(mouth.eyes_in_mask == 1.0);
    // A patch on one eye counts, an eye behind the outline of a profile does not.
    const Tensor one_eye = mask_without(30, 50, 55);
    CHECK(look_of(skin, one_eye, landmarks()).eyes_in_mask == 0.0);
    Landmarks profile = landmarks();
    profile[27] = {58.0, 40.0};
    CHECK(look_of(skin, one_eye, profile).eyes_in_mask == 1.0);
    CHECK(look_of(skin, mask_without(30, 50, 0), profile).eyes_in_mask == 0.0);
}

TEST_CASE("noise is measured in units of the brightness, and clipped pixels are counted",
          "[photo]") {
    const Tensor skin = face(0, 0, {});
    CHECK(look(skin).noise == Approx(0.0).margin(1e-6));
    CHECK(look(skin).clipped == 0.0);
    Tensor noisy = skin;
    Rng rng(1);
    constexpr double deviation = 0.06;
    for (float& value : noisy.mutable_values<float>())
        value += static_cast<float>(deviation * rng.normal());
    // The mean of three channels has a third of the variance.
    const double expected = deviation / std::sqrt(3.0) / (1.9 / 3.0);
    CHECK(look(noisy).noise == Approx(expected).epsilon(0.1));
    // Below the nose, which is in the middle of the disc.
    CHECK(look(face(56, 100, {1.0F, 0.8F, 0.7F})).clipped == Approx(0.5).margin(0.02));
    CHECK(look(face(0, 55, {0.0F, 0.005F, 0.0F})).clipped == Approx(0.5).margin(0.02));
    Tensor known = whole_mask();
    std::ranges::fill(known.mutable_values<float>().subspan(56 * side), 0.0F);
    CHECK(look(face(56, 100, {1.0F, 0.8F, 0.7F}), known).clipped == 0.0);
}

}  // namespace photo_look_tests
