#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/error.h"
#include "core/metrics.h"

using namespace stymo;

namespace {

/// The closed form of tests/golden/make_metric_vectors.py.
Tensor wave_image(std::int64_t height, std::int64_t width, std::int64_t channels, double phase) {
    Tensor image({height, width, channels}, DType::float64);
    const auto values = image.mutable_values<double>();
    std::size_t index = 0;
    for (std::int64_t y = 0; y < height; ++y) {
        for (std::int64_t x = 0; x < width; ++x) {
            for (std::int64_t c = 0; c < channels; ++c) {
                const auto row = static_cast<double>(y), column = static_cast<double>(x),
                           band = static_cast<double>(c + 1);
                values[index++] = 0.5 + 0.45 * std::sin(0.37 * row + 0.21 * column * band + phase) *
                                            std::cos(0.05 * row * column + phase);
            }
        }
    }
    return image;
}

}  // namespace

TEST_CASE("the metrics agree with scikit-image", "[metrics]") {
    std::ifstream file(STYMO_SOURCE_DIR "/tests/golden/metric_vectors.json");
    const auto cases = nlohmann::json::parse(file);
    REQUIRE(cases.size() == 4);
    for (const auto& values : cases) {
        const auto image = [&](const char* phase) {
            return wave_image(values["height"], values["width"], values["channels"], values[phase]);
        };
        const Tensor a = image("phase_a"), b = image("phase_b");
        CHECK(mean_absolute_error(a, b) ==
              Approx(values["mean_absolute_error"].get<double>()).epsilon(1e-12));
        CHECK(peak_signal_to_noise_ratio(a, b) ==
              Approx(values["peak_signal_to_noise_ratio"].get<double>()).epsilon(1e-12));
        CHECK(structural_similarity(a, b) ==
              Approx(values["structural_similarity"].get<double>()).epsilon(1e-10));

        const Tensor single_a = a.to(DType::float32), single_b = b.to(DType::float32);
        CHECK(structural_similarity(single_a, single_b) ==
              Approx(values["structural_similarity"].get<double>()).margin(1e-6));
    }
}

TEST_CASE("the paper's L1 sums over the channels", "[metrics]") {
    const Tensor black = Tensor::zeros({2, 2, 3}), grey = Tensor::full({2, 2, 3}, 0.25);
    CHECK(mean_absolute_error(black, grey) == 0.25);
    CHECK(l1_error(black, grey) == 0.75);
    CHECK(peak_signal_to_noise_ratio(black, grey) == Approx(-20.0 * std::log10(0.25)));
}

TEST_CASE("windows with an unknown pixel count for nothing in the structural similarity",
          "[metrics][unknown]") {
    const Tensor a = wave_image(30, 24, 3, 0.1), b = wave_image(30, 24, 3, 0.7);
    const auto rows_from = [](const Tensor& image, std::int64_t first) {
        const std::int64_t row = image.shape(1) * image.shape(2);
        Tensor part({image.shape(0) - first, image.shape(1), image.shape(2)}, image.dtype());
        std::ranges::copy(image.values<double>().subspan(static_cast<std::size_t>(first * row)),
                          part.mutable_values<double>().begin());
        return part;
    };
    Tensor counted = Tensor::full({30, 24, 1}, 1.0);
    CHECK(structural_similarity(a, b, counted) == structural_similarity(a, b));
    for (std::size_t column = 0; column < 24; ++column)
        counted.mutable_values<float>()[7 * 24 + column] = 0.0F;
    CHECK(structural_similarity(a, b, counted) ==
          Approx(structural_similarity(rows_from(a, 8), rows_from(b, 8))).epsilon(1e-12));
    CHECK(structural_similarity(a, b, Tensor::zeros({30, 24, 1})) == 1.0);
    CHECK_THROWS_AS(structural_similarity(a, b, Tensor::zeros({30, 23, 1})), ShapeError);
}

TEST_CASE("identical images have no error", "[metrics]") {
    const Tensor image = wave_image(16, 16, 3, 0.2);
    CHECK(l1_error(image, image) == 0.0);
    CHECK(peak_signal_to_noise_ratio(image, image) == std::numeric_limits<double>::infinity());
    CHECK(structural_similarity(image, image) == Approx(1.0).epsilon(1e-12));
    const Tensor black = Tensor::zeros({16, 16, 3});
    CHECK(structural_similarity(black, black) == Approx(1.0).epsilon(1e-12));
}

TEST_CASE("images that do not match are refused", "[metrics]") {
    const Tensor image = Tensor::zeros({16, 16, 3});
    CHECK_THROWS_AS(l1_error(image, Tensor::zeros({16, 15, 3})), ShapeError);
    CHECK_THROWS_AS(peak_signal_to_noise_ratio(image, image.to(DType::float64)), TypeError);
    CHECK_THROWS_AS(structural_similarity(Tensor::zeros({10, 16, 3}), Tensor::zeros({10, 16, 3})),
                    ShapeError);
}
