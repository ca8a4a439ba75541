// Vectors of numbers of 16 bits, whatever instruction set this processor has.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "nn/engine/colors.h"

using namespace stymo::kernels;

namespace {

/// Numbers of 16 bits, what lies between them, and what float32 has beyond them.
std::vector<float> numbers_to_round() {
    std::vector<float> numbers{std::numeric_limits<float>::infinity(),
                               std::numeric_limits<float>::max(),
                               std::numeric_limits<float>::denorm_min(),
                               65519.9F,
                               65520.0F,
                               1e-30F};
    for (std::uint32_t bits = 0; bits < 0x7C00; bits += 7) {
        const float x = widened(Float16{static_cast<std::uint16_t>(bits)}),
                    next = widened(Float16{static_cast<std::uint16_t>(bits + 1)});
        numbers.push_back(x);
        if (!std::isfinite(next)) break;
        const float middle = 0.5F * (x + next);
        numbers.push_back(middle);
        numbers.push_back(std::nextafter(middle, x));
        numbers.push_back(std::nextafter(middle, next));
    }
    const std::size_t count = numbers.size();
    for (std::size_t i = 0; i < count; ++i) numbers.push_back(-numbers[i]);
    return numbers;
}

}  // namespace

TEMPLATE_TEST_CASE("Vectors are rounded to 16 bits as single numbers are, and back", "", Float16,
                   BFloat16) {
    const auto rounded = [](float x) {
        if constexpr (std::is_same_v<TestType, Float16>)
            return rounded_to_float16(x);
        else
            return rounded_to_bfloat16(x);
    };
    const std::vector<float> numbers = numbers_to_round();
    std::vector<TestType> halves(numbers.size());
    narrow(halves.data(), numbers.data(), std::ssize(numbers));
    std::vector<float> back(numbers.size());
    widen(back.data(), halves.data(), std::ssize(numbers));
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        INFO(numbers[i]);
        REQUIRE(halves[i].bits == rounded(numbers[i]).bits);
        REQUIRE(back[i] == widened(halves[i]));
    }
}

TEST_CASE("What is no number stays none in 16 bits") {
    const std::vector<float> numbers(20, std::numeric_limits<float>::quiet_NaN());
    std::vector<Float16> halves(numbers.size());
    std::vector<BFloat16> shorts(numbers.size());
    narrow(halves.data(), numbers.data(), std::ssize(numbers));
    narrow(shorts.data(), numbers.data(), std::ssize(numbers));
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        CHECK(std::isnan(widened(halves[i])));
        CHECK(std::isnan(widened(shorts[i])));
    }
}
