#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/jpeg.h"
#include "core/metrics.h"

using namespace stymo;

namespace {

Tensor smooth_image(std::int64_t height, std::int64_t width) {
    Tensor image({height, width, 3});
    const std::span<float> values = image.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) {
        const auto column = static_cast<double>(i / 3 % static_cast<std::size_t>(width));
        values[i] = static_cast<float>(0.5 + 0.4 * std::sin(0.1 * column));
    }
    return image;
}

}  // namespace

TEST_CASE("an image survives JPEG, better at a higher quality") {
    const Tensor image = smooth_image(40, 56);
    const std::string small = jpeg_bytes(image, 30), large = jpeg_bytes(image, 95);
    CHECK(small.size() < large.size());
    const Tensor back = image_from_jpeg(large, 40 * 56);
    REQUIRE(back.shape() == image.shape());
    CHECK(peak_signal_to_noise_ratio(back, image) > 33.0);
    CHECK(peak_signal_to_noise_ratio(image_from_jpeg(small, 40 * 56), image) <
          peak_signal_to_noise_ratio(back, image));
}

TEST_CASE("bytes that are no whole JPEG file, or too many pixels, are refused") {
    const std::string bytes = jpeg_bytes(smooth_image(40, 56), 90);
    CHECK_THROWS_AS(image_from_jpeg("", 1000), FileError);
    CHECK_THROWS_AS(image_from_jpeg("hello", 1000), FileError);
    CHECK_THROWS_AS(image_from_jpeg(png_bytes(smooth_image(40, 56)), 10000), FileError);
    CHECK_THROWS_AS(image_from_jpeg(bytes.substr(0, bytes.size() / 2), 10000), FileError);
    CHECK_THROWS_AS(image_from_jpeg(bytes, 40 * 56 - 1), FileError);
}
