// Splats against closed forms, and their gradient against finite differences.
#include <catch2/catch.hpp>
#include <cmath>

#include "core/tensor_eigen.h"
#include "render/splats.h"

namespace splat_tests {

namespace {

using stymo::Splats;
using stymo::Tensor;

constexpr std::int64_t side = 32;
constexpr double focal = 2.0, distance = 5.0;

/// With `times` the distance and the focal length the image is as large, with less perspective.
stymo::Camera camera(double times = 1.0) {
    return stymo::camera_from_pose(stymo::orbit_pose(0.0, 0.0, 0.0, times * distance),
                                   {times * focal, 0.5, 0.5});
}

Tensor rows(std::int64_t columns, const std::vector<float>& values) {
    return Tensor::from({std::ssize(values) / columns, columns}, std::span<const float>(values));
}

double logit(double opacity) {
    return std::log(opacity / (1.0 - opacity));
}

/// Splats that face the camera, at these depths z and with these opacities, of deviation `size`.
Splats facing(const std::vector<float>& z, const std::vector<double>& opacities, double size) {
    const auto count = std::ssize(z);
    Splats splats{Tensor::zeros({count, 3}), Tensor::zeros({count, 3}),
                  Tensor::full({count, 1}, std::log(size)), Tensor({count, 1}),
                  Tensor::zeros({count, 12})};
    for (Eigen::Index i = 0; i < count; ++i) {
        const auto k = static_cast<std::size_t>(i);
        stymo::mutable_matrix_map<float>(splats.centers)(i, 2) = z[k];
        stymo::mutable_matrix_map<float>(splats.normals)(i, 2) = 1.0F;
        stymo::mutable_matrix_map<float>(splats.logits)(i, 0) =
            static_cast<float>(logit(opacities[k]));
    }
    return splats;
}

}  // namespace

TEST_CASE("A splat that faces the camera is a round Gaussian", "[splats]") {
    const Splats splats = facing({0.5F}, {0.8}, 0.2);
    const stymo::RasterImage image = stymo::rendered_splats(splats, camera(), side);
    const double pixels = focal * side / (distance - 0.5);
    const double variance = 0.2 * 0.2 * pixels * pixels + 0.3;
    for (std::int64_t i = 0; i < side * side; ++i) {
        const double x = double(i % side) + 0.5 - side / 2.0;
        const double y = double(i / side) + 0.5 - side / 2.0;
        const double expected = 0.8 * std::exp(-0.5 * (x * x + y * y) / variance);
        const auto pixel = static_cast<std::size_t>(i);
        const float coverage = image.coverage.values<float>()[pixel];
        if (std::abs(expected - 1.0 / 255.0) < 1e-5) continue;
        CHECK(coverage == Approx(expected < 1.0 / 255.0 ? 0.0 : expected).margin(1e-6));
        CHECK(image.color.values<float>()[3 * pixel] == Approx(0.5 * coverage).margin(1e-6));
    }
}

TEST_CASE("Seen from its edge a splat is as thin as its normal says", "[splats]") {
    Splats splats = facing({0.0F}, {0.9}, 0.3);
    splats.normals = rows(3, {1.0F, 0.0F, 0.0F});
    const stymo::RasterImage image = stymo::rendered_splats(splats, camera(), side);
    const double pixels = focal * side / distance;
    const double tall = 0.3 * 0.3 * pixels * pixels;
    const double wide = tall * stymo::splat_thickness * stymo::splat_thickness;
    const auto at = [&](std::int64_t x, std::int64_t y) {
        return image.coverage.values<float>()[static_cast<std::size_t>(y * side + x)];
    };
    CHECK(at(18, 16) == Approx(0.9 * std::exp(-0.5 * (6.25 / (wide + 0.3) + 0.25 / (tall + 0.3)))));
    CHECK(at(16, 18) == Approx(0.9 * std::exp(-0.5 * (0.25 / (wide + 0.3) + 6.25 / (tall + 0.3)))));
}

TEST_CASE("The nearer splat hides the farther one by its opacity", "[splats]") {
    Splats splats = facing({0.0F, 1.0F}, {0.7, 0.6}, 2.0);
    // The constant harmonic: the far one is black, the near one white.
    auto colors = stymo::mutable_matrix_map<float>(splats.colors);
    colors(0, 0) = -0.5F / 0.28209479F;
    colors(1, 0) = 0.5F / 0.28209479F;
    const stymo::RasterImage image = stymo::rendered_splats(splats, camera(), side);
    const auto middle = static_cast<std::size_t>(side * side / 2 + side / 2);
    CHECK(image.coverage.values<float>()[middle] == Approx(1.0 - 0.3 * 0.4).margin(1e-3));
    CHECK(image.color.values<float>()[3 * middle] == Approx(0.6).margin(1e-3));
}

TEST_CASE("The linear harmonics colour a splat by the direction of view", "[splats]") {
    Splats splats = facing({0.0F}, {0.9}, 1.0);
    stymo::mutable_matrix_map<float>(splats.colors)(0, 6) = 0.4F;
    const auto red = [&](double yaw) {
        const stymo::Camera from =
            stymo::camera_from_pose(stymo::orbit_pose(yaw, 0.0, 0.0, distance), {focal, 0.5, 0.5});
        const stymo::RasterImage image = stymo::rendered_splats(splats, from, side);
        const auto middle = static_cast<std::size_t>(side * side / 2 + side / 2);
        return image.color.values<float>()[3 * middle] / image.coverage.values<float>()[middle];
    };
    for (const double yaw : {0.0, 0.5, 1.0})
        CHECK(red(yaw) == Approx(0.5 - 0.4 * 0.48860251 * std::cos(yaw)).margin(1e-5));
}

TEST_CASE("The gradient of the loss equals finite differences", "[splats]") {
    // So large that every pixel is well above the cut at 1 / 255, and so far that shapes hardly
    // depend on the centres: what is left out of the gradient is then nearly 0.
    Splats splats = facing({-0.2F, 0.0F, 0.1F, 0.3F}, {0.6, 0.3, 0.8, 0.5}, 1.0);
    splats.centers = rows(3, {0.1F, 0, -0.2F, 0, 0.1F, 0, -0.1F, 0, 0.1F, 0.05F, 0.05F, 0.3F});
    splats.normals = rows(3, {0, 0, 1, 0.6F, 0, 0.8F, 0, -0.6F, 0.8F, 0, 0, 1});
    auto colors = stymo::mutable_matrix_map<float>(splats.colors);
    for (Eigen::Index i = 0; i < colors.size(); ++i)
        colors.data()[i] = 0.3F * static_cast<float>(std::sin(double(i)));
    stymo::TextureView view{camera(4000.0), Tensor({side, side, 3}), Tensor({side, side, 1})};
    for (Tensor* tensor : {&view.image, &view.mask}) {
        const std::span<float> values = tensor->mutable_values<float>();
        for (std::size_t i = 0; i < values.size(); ++i)
            values[i] = 0.5F + 0.5F * static_cast<float>(std::sin(0.1 * double(i)));
    }
    const Splats gradient = stymo::splat_loss(splats, view).gradient;
    const auto check = [&](Tensor Splats::*part, double step) {
        const std::span<const float> expected = (gradient.*part).values<float>();
        double squares = 0.0, errors = 0.0;
        for (std::size_t i = 0; i < expected.size(); ++i) {
            const auto loss = [&](double by) {
                Splats moved = splats;
                (moved.*part).mutable_values<float>()[i] += static_cast<float>(by);
                return stymo::splat_loss(moved, view).value;
            };
            const double difference = (loss(step) - loss(-step)) / (2.0 * step);
            squares += difference * difference;
            errors += std::pow(double{expected[i]} - difference, 2.0);
        }
        CAPTURE(std::sqrt(errors / squares));
        CHECK(std::sqrt(errors / squares) < 1e-3);
    };
    check(&Splats::colors, 1e-2);
    check(&Splats::logits, 1e-2);
    check(&Splats::sizes, 1e-2);
    check(&Splats::centers, 4e-2);
}

}  // namespace splat_tests
