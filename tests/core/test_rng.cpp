#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/rng.h"

using namespace stymo;

TEST_CASE("Philox4x32-10 gives the known answers of Random123") {
    using Words = std::array<std::uint32_t, 4>;
    CHECK(philox4x32({0, 0, 0, 0}, {0, 0}) ==
          Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
    CHECK(philox4x32({0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}, {0xffffffff, 0xffffffff}) ==
          Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
    CHECK(philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}) ==
          Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});
}

TEST_CASE("the first number of a generator is the first half of block zero") {
    CHECK(Rng(0).bits() == 0xe169c58d6627e8d5ULL);
}

TEST_CASE("a generator made of a saved state continues the sequence") {
    Rng original(42);
    for (int i = 0; i < 5; ++i) {
        static_cast<void>(original.normal());
    }
    Rng resumed(original.state());
    CHECK(original.state().counter == 5);
    for (int i = 0; i < 5; ++i) {
        CHECK(original.bits() == resumed.bits());
    }
    CHECK(original.state() == resumed.state());
}

TEST_CASE("a generator that skips numbers goes on as if it had drawn them") {
    Rng drawn(42);
    for (int i = 0; i < 7; ++i) static_cast<void>(drawn.uniform());
    CHECK(Rng(42).skipped(7).state() == drawn.state());
    CHECK(Rng(42).skipped(7).bits() == drawn.bits());
}

TEST_CASE("splitting leaves the parent as it was and gives distinct generators") {
    const Rng parent(7);
    std::set<std::uint64_t> firsts;
    const std::vector<std::string> names = {
        "", "a", "b", "ab", "data", "weights", "12345678", "123456789", std::string("a\0", 2)};
    for (const std::string& name : names) {
        firsts.insert(parent.split(name).bits());
    }
    for (std::uint64_t index = 0; index < 1000; ++index) {
        firsts.insert(parent.split(index).bits());
    }
    firsts.insert(Rng(parent.state()).bits());
    CHECK(firsts.size() == names.size() + 1001);
    CHECK(parent.state() == Rng::State{7, 0});

    Rng advanced(7);
    static_cast<void>(advanced.bits());
    CHECK(advanced.split("data").bits() == parent.split("data").bits());
}

TEST_CASE("uniform numbers have the moments of their distribution and stay inside it") {
    const int count = 100000;
    const Tensor values = Rng(3).uniform({count}, -2.0, 4.0, DType::float64);
    double sum = 0.0;
    double squares = 0.0;
    for (const double value : values.values<double>()) {
        REQUIRE(value >= -2.0);
        REQUIRE(value < 4.0);
        sum += value;
        squares += (value - 1.0) * (value - 1.0);
    }
    // Five standard errors: sqrt(3 / count) for the mean, sqrt((16.2 - 9) / count) for the
    // variance.
    CHECK(std::abs(sum / count - 1.0) < 5.0 * std::sqrt(3.0 / count));
    CHECK(std::abs(squares / count - 3.0) < 5.0 * std::sqrt(7.2 / count));
}

TEST_CASE("normal numbers have the first four moments of their distribution") {
    const int count = 100000;
    const Tensor values = Rng(4).normal({count}, 0.0, 1.0, DType::float64);
    std::array<double, 4> moments{};
    for (const double value : values.values<double>()) {
        double power = 1.0;
        for (double& moment : moments) {
            power *= value;
            moment += power / count;
        }
    }
    CHECK(std::abs(moments[0]) < 5.0 * std::sqrt(1.0 / count));
    CHECK(std::abs(moments[1] - 1.0) < 5.0 * std::sqrt(2.0 / count));
    CHECK(std::abs(moments[2]) < 5.0 * std::sqrt(15.0 / count));
    CHECK(std::abs(moments[3] - 3.0) < 5.0 * std::sqrt(96.0 / count));
}

TEST_CASE("float32 and float64 tensors hold the same numbers") {
    const Tensor narrow = Rng(5).normal({4, 3}, 1.0, 2.0);
    const Tensor wide = Rng(5).normal({4, 3}, 1.0, 2.0, DType::float64);
    REQUIRE(narrow.dtype() == DType::float32);
    for (std::size_t i = 0; i < 12; ++i) {
        CHECK(narrow.values<float>()[i] == static_cast<float>(wide.values<double>()[i]));
    }
}

TEST_CASE("a float32 uniform never rounds up to its open end") {
    const Tensor values = Rng(6).uniform({10000}, 0.0, 1e-45);
    for (const float value : values.values<float>()) {
        REQUIRE(value == 0.0F);
    }
}

TEST_CASE("integers below a bound are equally likely") {
    Rng rng(8);
    std::array<int, 7> counts{};
    const int draws = 70000;
    for (int i = 0; i < draws; ++i) {
        ++counts[static_cast<std::size_t>(rng.below(7))];
    }
    double chi_square = 0.0;
    for (const int count : counts) {
        chi_square += (count - 10000.0) * (count - 10000.0) / 10000.0;
    }
    CHECK(chi_square < 22.46);  // 0.999 quantile for six degrees of freedom
    CHECK(rng.below(1) == 0);
    CHECK_THROWS_AS(rng.below(0), ValueError);
    CHECK_THROWS_AS(rng.below(-3), ValueError);
}
