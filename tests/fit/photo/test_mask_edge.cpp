#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "fit/photo/mask_edge.h"

namespace mask_edge_tests {

using namespace stymo;

namespace {

constexpr std::int64_t side = 256;

/// An image or a mask with the values of a function of the distance from a head's outline.
template <class Function>
Tensor by_distance(std::int64_t channels, const Function& value) {
    Tensor result({side, side, channels});
    auto next = result.mutable_values<float>().begin();
    for (std::int64_t row = 0; row < side; ++row)
        for (std::int64_t column = 0; column < side; ++column)
            for (std::int64_t channel = 0; channel < channels; ++channel)
                *next++ =
                    static_cast<float>(value(80.0 - std::hypot(static_cast<double>(row) - 128.0,
                                                               static_cast<double>(column) - 128.0),
                                             channel));
    return result;
}

double share(double distance) {
    return std::clamp(0.5 + distance / 2.0, 0.0, 1.0);
}

/// A head before a wall, with a soft edge at the distance 0.
Tensor photo(double wall) {
    return by_distance(3, [wall](double distance, std::int64_t channel) {
        const double head = 0.2 + 0.05 * static_cast<double>(channel);
        return share(distance) * head + (1.0 - share(distance)) * wall;
    });
}

double largest_difference(const Tensor& a, const Tensor& b) {
    const std::vector<double> first = a.to_vector(), second = b.to_vector();
    double largest = 0.0;
    for (std::size_t i = 0; i < first.size(); ++i)
        largest = std::max(largest, std::abs(first[i] - second[i]));
    return largest;
}

}  // namespace

TEST_CASE("a mask that reaches onto a bright wall ends where the head's colour ends") {
    const Tensor wide =
        by_distance(1, [](double distance, std::int64_t) { return share(distance + 1.5); });
    const Tensor expected =
        by_distance(1, [](double distance, std::int64_t) { return share(distance); });
    CHECK(largest_difference(edge_by_color(wide, photo(0.95)), expected) < 0.01);
}

TEST_CASE(
    "the shadow of a chin on the neck does not move the edge, a wall of another colour does") {
    const std::vector<double> skin{0.8, 0.6, 0.5};
    const auto before = [&](const std::vector<double>& behind, double shift) {
        return by_distance(3, [&, shift](double distance, std::int64_t channel) {
            const auto c = static_cast<std::size_t>(channel);
            const double a = share(distance + shift);
            return a * skin[c] + (1.0 - a) * behind[c];
        });
    };
    const Tensor mask =
        by_distance(1, [](double distance, std::int64_t) { return share(distance); });
    // The shadow begins two pixels farther inside than the jaw.
    const std::vector<double> neck{0.48, 0.36, 0.3}, wall{0.3, 0.4, 0.6};
    CHECK(largest_difference(edge_by_color(mask, before(neck, -2.0)), mask) < 1e-3);
    CHECK(largest_difference(edge_by_color(mask, before(wall, -2.0)), mask) > 0.5);
    // A bright wall of the hue of skin is no shade.
    CHECK(largest_difference(edge_by_color(mask, before({1.0, 0.76, 0.64}, -2.0)), mask) > 0.2);
}

TEST_CASE("what has the head's colour behind a gap is no head") {
    // A chin, its shadow, and the neck, which the mask takes for chin; then a dark collar.
    const Tensor mask =
        by_distance(1, [](double distance, std::int64_t) { return share(distance + 1.0); });
    const Tensor chin = by_distance(3, [](double distance, std::int64_t) {
        return distance > 2.0 || (distance < 0.5 && distance > -1.5) ? 0.8 : 0.1;
    });
    const Tensor result = edge_by_color(mask, chin);
    double neck = 0.0, face = 1.0;
    for (std::int64_t row = 0; row < side; ++row) {
        const double distance = 80.0 - std::abs(static_cast<double>(row) - 128.0);
        const auto value =
            static_cast<double>(result.values<float>()[static_cast<std::size_t>(row * side + 128)]);
        if (distance < 0.5) neck = std::max(neck, value);
        if (distance > 2.5) face = std::min(face, value);
    }
    CHECK(neck < 0.01);
    CHECK(face > 0.99);
}

TEST_CASE("the smallest masks get an edge too") {
    constexpr std::int64_t small = 64;
    Tensor mask({small, small, 1}), image({small, small, 3});
    auto value = mask.mutable_values<float>().begin(),
         color = image.mutable_values<float>().begin();
    for (std::int64_t row = 0; row < small; ++row)
        for (std::int64_t column = 0; column < small; ++column) {
            const bool head = column < 31;
            *value++ = column < 32 ? 1.0F : 0.0F;  // a column too far
            for (int channel = 0; channel < 3; ++channel) *color++ = head ? 0.2F : 0.9F;
        }
    const Tensor result = edge_by_color(mask, image);
    const auto of_column = [&](std::size_t column) { return result.values<float>()[column]; };
    CHECK(of_column(30) == 1.0F);
    CHECK(of_column(31) < 0.01F);
    CHECK(of_column(32) == 0.0F);
}

TEST_CASE(
    "an unsure edge between a face and a neck of the same colour is crisp, and stays in place") {
    // As soft_head_mask leaves it: beyond a 64th of the side the network is sure.
    const Tensor unsure = by_distance(1, [](double distance, std::int64_t) {
        if (std::abs(distance) >= 3.5) return distance > 0.0 ? 1.0 : 0.0;
        return 0.5 + distance / 16.0;
    });
    const Tensor result = edge_by_color(unsure, photo(0.25));
    double between = 0.0;  // the width of what is neither head nor not, along a radius
    for (std::int64_t row = 0; row < side / 2; ++row) {
        const auto value =
            static_cast<double>(result.values<float>()[static_cast<std::size_t>(row * side + 128)]);
        const double distance = 80.0 - std::abs(static_cast<double>(row) - 128.0);
        between += value > 0.02 && value < 0.98 ? 1.0 : 0.0;
        if (std::abs(distance) > 3.0) CHECK(value == Approx(distance > 0.0 ? 1.0 : 0.0));
    }
    CHECK(between >= 1.0);
    CHECK(between <= 4.0);
}

TEST_CASE("where what is around a head has several colours, their mean does not move its edge") {
    const Tensor mask =
        by_distance(1, [](double distance, std::int64_t) { return share(distance); });
    // Stripes of skin and of a dark collar, whose mean the shaded rim of the face resembles.
    Tensor image =
        by_distance(3, [](double distance, std::int64_t) { return distance > 4.0 ? 0.8 : 0.5; });
    const auto colors = image.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i)
        if (mask.values<float>()[static_cast<std::size_t>(i)] == 0.0F)
            for (std::int64_t channel = 0; channel < 3; ++channel)
                colors[static_cast<std::size_t>(3 * i + channel)] = i / 4 % 2 == 0 ? 0.9F : 0.05F;
    const Tensor result = edge_by_color(mask, image);
    for (std::int64_t row = 0; row < side / 2; ++row)
        CHECK(
            result.values<float>()[static_cast<std::size_t>(row * side + 128)] ==
            Approx(mask.values<float>()[static_cast<std::size_t>(row * side + 128)]).margin(1e-3));
}

TEST_CASE("a mask stays where the head has the wall's colour, or the photo neither's") {
    const Tensor mask =
        by_distance(1, [](double distance, std::int64_t) { return share(distance + 1.0); });
    CHECK(largest_difference(edge_by_color(mask, photo(0.25)), mask) < 1e-3);
    const Tensor rimmed = by_distance(3, [](double distance, std::int64_t channel) {
        if (std::abs(distance) < 3.0) return channel == 0 ? 1.0 : 0.0;  // a red collar
        return distance > 0.0 ? 0.3 : 0.8;
    });
    CHECK(largest_difference(edge_by_color(mask, rimmed), mask) < 1e-3);
    // A neck is outside the mask, and has the colour of the head.
    const Tensor narrow =
        by_distance(1, [](double distance, std::int64_t) { return distance > 2.0 ? 1.0 : 0.0; });
    CHECK(largest_difference(edge_by_color(narrow, photo(0.95)), narrow) < 1e-3);
    // Without anything inside or around there is nothing to compare with.
    const Tensor everywhere = Tensor::full({side, side, 1}, 1.0);
    CHECK(largest_difference(edge_by_color(everywhere, photo(0.95)), everywhere) < 1e-3);
    CHECK_THROWS_AS(edge_by_color(mask, Tensor::zeros({side, side, 1})), ShapeError);
}

}  // namespace mask_edge_tests
