#include <catch2/catch.hpp>

#include "core/error.h"
#include "nn/models/display_image.h"

using namespace stymo;

TEST_CASE("an image is one image of a batch, mapped from [-1, 1] to [0, 1] and clipped",
          "[image]") {
    const std::vector<double> numbers{9.0, 9.0, 9.0, -1.0, 0.0, 1.0};
    const Tensor images = Tensor::from({2, 1, 1, 3}, std::span<const double>(numbers));
    const Tensor shown = display_image(images, 1);
    CHECK(shown.shape() == Shape{1, 1, 3});
    CHECK(shown.to_vector() == std::vector<double>{0.0, 0.5, 1.0});
    CHECK(display_image(images, 0).to_vector() == std::vector<double>{1.0, 1.0, 1.0});
    CHECK_THROWS_AS(display_image(images, 2), ShapeError);
    CHECK_THROWS_AS(display_image(images, -1), ShapeError);
}

TEST_CASE("a mask of a batch is taken as it is, and blackens what it leaves out", "[image]") {
    const std::vector<double> numbers{1.0, 1.0, 0.0, 0.25};
    const Tensor mask =
        display_mask(Tensor::from({2, 1, 2, 1}, std::span<const double>(numbers)), 1);
    CHECK(mask.shape() == Shape{1, 2, 1});
    CHECK(mask.to_vector() == std::vector<double>{0.0, 0.25});
    const std::vector<double> colors{0.5, 0.6, 0.7, 0.8, 0.4, 1.0};
    CHECK(
        masked_image(Tensor::from({1, 2, 3}, std::span<const double>(colors)), mask).to_vector() ==
        std::vector<double>{0.0, 0.0, 0.0, 0.2, 0.1, 0.25});
}
