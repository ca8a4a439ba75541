#include <catch2/catch.hpp>

#include "core/error.h"
#include "fit/edit/color_edit.h"

using namespace stymo;

namespace {

/// Left half red, right half blue with a red square in it.
Tensor two_colors(std::int64_t side) {
    Tensor image = Tensor::zeros({side, side, 3});
    const std::span<float> values = image.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const std::int64_t row = i / side, column = i % side;
        const bool square = column > side * 3 / 4 && row > side * 3 / 4;
        values[static_cast<std::size_t>(3 * i + (column < side / 2 || square ? 0 : 2))] = 0.8F;
    }
    return image;
}

double share(const Tensor& mask) {
    double sum = 0.0;
    for (const float value : mask.values<float>()) sum += static_cast<double>(value);
    return sum / static_cast<double>(mask.size());
}

}  // namespace

TEST_CASE("a region is what is connected to the point and of its colour") {
    const Tensor image = two_colors(64);
    const Tensor left = region_at(image, 0.1, 0.5);
    REQUIRE(left.shape() == Shape{64, 64, 1});
    CHECK(share(left) == Approx(0.5).margin(0.04));
    CHECK(left.values<float>()[64 * 32 + 10] == 1.0F);
    CHECK(left.values<float>()[64 * 60 + 60] == 0.0F);  // as red, but apart
    CHECK(share(region_at(image, 0.9, 0.95)) == Approx(1.0 / 16.0).margin(0.025));
}

TEST_CASE("a point outside the image is refused") {
    CHECK_THROWS_AS(region_at(two_colors(16), 1.2, 0.5), ValueError);
    CHECK_THROWS_AS(region_at(two_colors(16), 0.5, 0.5, 0.0), ValueError);
    CHECK_THROWS_AS(region_at(Tensor::zeros({4, 5, 3}), 0.5, 0.5), ShapeError);
}
