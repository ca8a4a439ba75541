#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/rng.h"
#include "fit/fit_report.h"

using namespace stymo;

namespace {

constexpr std::int64_t side = 16;

/// 1 on the left half.
Tensor left_half() {
    Tensor mask({side, side, 1});
    const std::span<float> values = mask.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = i % side < side / 2 ? 1.0F : 0.0F;
    return mask;
}

}  // namespace

TEST_CASE("what differs outside the mask does not count", "[evaluation]") {
    Rng rng(1);
    const Tensor image = rng.uniform({side, side, 3}, 0.0, 1.0);
    Tensor other = image;
    const std::span<float> values = other.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        if (i / 3 % side >= side / 2) values[i] = 1.0F - values[i];
    const ImageMetrics metrics = MetricTarget(other, left_half()).measure(image);
    CHECK(metrics.l1 == 0.0);
    CHECK(metrics.l1_mean == 0.0);
    CHECK(metrics.ssim == Approx(1.0));
    CHECK(metrics.psnr == std::numeric_limits<double>::infinity());
}

TEST_CASE("metrics of the head are averaged over the whole frame", "[evaluation]") {
    const Tensor target = Tensor::full({side, side, 3}, 0.25);
    const Tensor image = Tensor::full({side, side, 3}, 0.75);
    const ImageMetrics metrics = MetricTarget(target, left_half()).measure(image);
    // Half of the pixels differ, by one half in each of three channels.
    CHECK(metrics.l1_mean == Approx(0.25));
    CHECK(metrics.l1 == Approx(0.75));
    CHECK(metrics.psnr == Approx(-10.0 * std::log10(0.125)));
    CHECK(metrics.ssim < 0.9);
}

TEST_CASE("metrics of a photo with unknown pixels are means over the others",
          "[evaluation][unknown]") {
    Tensor image = Tensor::full({side, side, 3}, 0.75);
    const Tensor known = left_half(), everywhere = Tensor::full({side, side, 1}, 1.0);
    const MetricTarget measured(Tensor::full({side, side, 3}, 0.25), everywhere, nullptr, known);
    const ImageMetrics metrics = measured.measure(image);
    CHECK(metrics.l1_mean == Approx(0.5));
    CHECK(metrics.l1 == Approx(1.5));
    CHECK(metrics.psnr == Approx(-10.0 * std::log10(0.25)));
    const std::span<float> values = image.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        if (i / 3 % side >= side / 2) values[i] = 0.1F;
    CHECK(measured.measure(image).psnr == metrics.psnr);
}

TEST_CASE("a soft mask weighs image and target alike", "[evaluation]") {
    const ImageMetrics metrics =
        MetricTarget(Tensor::full({side, side, 3}, 0.25), Tensor::full({side, side, 1}, 0.5))
            .measure(Tensor::full({side, side, 3}, 0.75));
    CHECK(metrics.l1_mean == Approx(0.25));
}

TEST_CASE("scores of several images are averaged one by one", "[evaluation]") {
    const ImageMetrics average =
        mean(std::vector<ImageMetrics>{{0.1, 0.2, 0.3, 20.0}, {0.3, 0.4, 0.5, 30.0}});
    CHECK(average.l1 == Approx(0.2));
    CHECK(average.l1_mean == Approx(0.3));
    CHECK(average.ssim == Approx(0.4));
    CHECK(average.psnr == Approx(25.0));
    CHECK(mean(std::vector<ImageMetrics>{}).l1 == 0.0);
}

TEST_CASE("the median of several images is taken of each metric by itself", "[evaluation]") {
    const ImageMetrics middle = median({{0.1, 0.9, 0.3, 20.0},
                                        {0.3, 0.4, 0.5, 30.0},
                                        {0.7, 0.1, 0.4, std::numeric_limits<double>::infinity()}});
    CHECK(middle.l1 == 0.3);
    CHECK(middle.l1_mean == 0.4);
    CHECK(middle.ssim == 0.4);
    CHECK(middle.psnr == 30.0);
    CHECK_FALSE(middle.lpips.has_value());
    CHECK(median({{.lpips = 0.5}, {.lpips = 0.25}}).lpips.value() == 0.375);
    CHECK(median(std::vector<ImageMetrics>{}).psnr == 0.0);
}

TEST_CASE("LPIPS is measured where a network is given, between masked images", "[evaluation]") {
    constexpr std::int64_t larger = 32;
    const Lpips lpips({.network = "squeezenet1_1", .trunk = "random", .heads = "random"}, "");
    Rng rng(2);
    const Tensor a = rng.uniform({larger, larger, 3}, 0.0, 1.0);
    const Tensor b = rng.uniform({larger, larger, 3}, 0.0, 1.0);
    const Tensor everywhere = Tensor::full({larger, larger, 1}, 1.0);
    const double expected =
        lpips.distance(lpips.features(lpips_input(a)), lpips.features(lpips_input(b)))
            .value()
            .item();
    CHECK(MetricTarget(b, everywhere, &lpips).measure(a).lpips.value() == Approx(expected));
    CHECK_FALSE(MetricTarget(b, everywhere).measure(a).lpips.has_value());
    CHECK(MetricTarget(b, Tensor::zeros({larger, larger, 1}), &lpips).measure(a).lpips.value() ==
          0.0);
    const ImageMetrics average = mean({{.lpips = 0.25}, {.lpips = 0.75}});
    CHECK(average.lpips.value() == Approx(0.5));
    CHECK_THAT(to_json(average).text(), Catch::Contains("\"lpips\":0.5"));
}

TEST_CASE("scores are written with a null for an infinite one", "[evaluation]") {
    const nlohmann::json json = nlohmann::json::parse(
        to_json(ImageMetrics{0.5, 0.25, 0.75, std::numeric_limits<double>::infinity()}).text());
    CHECK(json ==
          nlohmann::json{{"l1", 0.5}, {"l1_mean", 0.25}, {"ssim", 0.75}, {"psnr", nullptr}});
}
