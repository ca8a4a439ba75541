#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/image_augmentation.h"
#include "support/check_close.h"
#include "support/check_grad.h"

using namespace stymo;

namespace {

Tensor noise(std::int64_t count, std::int64_t side) {
    Rng rng(3);
    return rng.uniform({count, side, side, 3}, -1.0, 1.0, DType::float64);
}

Tensor changed(const Tensor& images, const ImageAugmentation& augmentation) {
    const std::vector<ImageAugmentation> all(static_cast<std::size_t>(images.shape(0)),
                                             augmentation);
    return augmented(images, all).value();
}

/// An image that is the same but for the pixels' positions.
Tensor moved_right(const Tensor& images, std::int64_t pixels) {
    const std::int64_t side = images.shape(2);
    return (pad(slice(Variable(images), 2, 0, side - pixels) + 1.0, 2, pixels, 0) - 1.0).value();
}

}  // namespace

TEST_CASE("An augmentation of probability 0 changes nothing", "[augmentation]") {
    const Tensor images = noise(2, 6);
    const ImageAugmentation none = drawn_augmentation(Rng(1), 0.0);
    CHECK(none == ImageAugmentation{});
    CHECK(test::check_close(changed(images, none), images, 1e-12).passed);
    CHECK(test::check_close(augmented(images, {}).value(), images, 0.0).passed);
}

TEST_CASE("Mirrored, moved and turned images", "[augmentation]") {
    const Tensor images = noise(2, 6);
    CHECK(test::check_close(changed(images, {.source_from_target = {-1, 0, 0, 0, 1, 0}}),
                            flip(images, 2).value(), 1e-12)
              .passed);
    // A pixel is a third of [-1, 1] here; what comes from beyond the border is black.
    CHECK(test::check_close(changed(images, {.source_from_target = {1, 0, -2.0 / 3, 0, 1, 0}}),
                            moved_right(images, 2), 1e-12)
              .passed);
    const Tensor quarter = changed(images, {.source_from_target = {0, -1, 0, 1, 0, 0}});
    CHECK(test::check_close(quarter, flip(permute(images, {0, 2, 1, 3}), 1).value(), 1e-12).passed);
    // Half a pixel: the mean of neighbours.
    const Tensor half = changed(images, {.source_from_target = {1, 0, 1.0 / 6, 0, 1, 0}});
    const Variable right = slice(Variable(images), 2, 1, 6),
                   left = slice(Variable(images), 2, 0, 5);
    CHECK(test::check_close(slice(Variable(half), 2, 0, 5).value(), ((left + right) * 0.5).value(),
                            1e-12)
              .passed);
}

TEST_CASE("Colours are changed by the matrix", "[augmentation]") {
    const Tensor images = noise(1, 4);
    const Tensor result = changed(images, {.color = {0, 1, 0, 0.5, 0, 0, 2, 0, 1, 0, 0, -1}});
    const auto channel = [](const Tensor& x, std::int64_t c) {
        return slice(Variable(x), 3, c, c + 1);
    };
    const Variable expected =
        concat({channel(images, 1) + 0.5, channel(images, 2) * 2.0, channel(images, 0) - 1.0}, 3);
    CHECK(test::check_close(result, expected.value(), 1e-12).passed);
}

TEST_CASE("Drawn colours keep gray gray, and lengths but for contrast and saturation",
          "[augmentation]") {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
        const auto color = drawn_augmentation(Rng(seed), 1.0).color;
        const auto row_sum = [&](std::size_t row) {
            return color[4 * row] + color[4 * row + 1] + color[4 * row + 2];
        };
        CHECK(row_sum(0) == Approx(row_sum(1)));
        CHECK(row_sum(0) == Approx(row_sum(2)));
        CHECK(color[3] == Approx(color[7]));
        CHECK(color[3] == Approx(color[11]));
    }
}

TEST_CASE("Transformations take place with their probability", "[augmentation]") {
    constexpr int count = 4000;
    constexpr double probability = 0.4;
    int mirrored = 0, brighter = 0;
    double area = 0.0;
    for (std::uint64_t seed = 0; seed < count; ++seed) {
        const ImageAugmentation one = drawn_augmentation(Rng(9).split(seed), probability);
        const auto& m = one.source_from_target;
        const double determinant = m[0] * m[4] - m[1] * m[3];
        if (determinant < 0.0) ++mirrored;
        if (one.color[3] != 0.0) ++brighter;
        area += std::abs(std::log(std::abs(determinant)));
    }
    // Half of those that take place mirror; deviations of four standard errors are allowed.
    CHECK(std::abs(mirrored - count * probability / 2) < 4 * std::sqrt(count * 0.2 * 0.8));
    CHECK(std::abs(brighter - count * probability) < 4 * std::sqrt(count * 0.4 * 0.6));
    // E |2 log size| where the logarithm of the size has the deviation 0.2 ln 2.
    const double expected =
        probability * 2.0 * 0.2 * std::numbers::ln2 * std::sqrt(2.0 / std::numbers::pi);
    CHECK(area / count == Approx(expected).epsilon(0.1));
}

TEST_CASE("The probability follows the mean sign of photos' logits", "[augmentation]") {
    AdaptiveProbability probability(0.6, 100.0);
    CHECK(probability.value() == 0.0);
    probability.update(0.5, 10.0);
    CHECK(probability.value() == 0.0);
    for (int step = 0; step < 3; ++step) probability.update(0.7, 10.0);
    CHECK(probability.value() == Approx(0.3));
    probability.update(0.1, 10.0);
    CHECK(probability.value() == Approx(0.2));
    for (int step = 0; step < 20; ++step) probability.update(1.0, 10.0);
    CHECK(probability.value() == 1.0);
    AdaptiveProbability never(0.0, 100.0);
    never.update(1.0, 10.0);
    CHECK(never.value() == 0.0);
}

TEST_CASE("Augmentations that do not fit the images are refused", "[augmentation]") {
    const std::vector<ImageAugmentation> two(2);
    CHECK_THROWS_AS(augmented(noise(1, 4), two), ShapeError);
    CHECK_THROWS_AS(augmented(Tensor::zeros({2, 4, 5, 3}), two), ShapeError);
}

TEST_CASE("Two derivatives through turned, stretched and recoloured images", "[augmentation]") {
    const double cosine = std::cos(0.4), sine = std::sin(0.4);
    const std::vector<ImageAugmentation> augmentations{
        {.source_from_target = {1.3 * cosine, -sine, 0.1, 0.8 * sine, cosine, -0.2},
         .color = {0.9, 0.2, -0.1, 0.05, 0.0, 1.1, 0.1, -0.1, 0.3, 0.0, 0.7, 0.2}},
        drawn_augmentation(Rng(3), 1.0)};
    // Squared, so that the second derivative is not zero.
    const test::GradReport report = test::check_grad(
        "augmentation",
        [&](const std::vector<Variable>& x) { return square(augmented(x[0], augmentations)); },
        {noise(2, 6)});
    INFO(report.message);
    CHECK(report.passed);
}
