#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "core/ops/ops.h"
#include "fit/edit/style_mix.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// base + factors[g] (other - base), group by group.
Codes between(const Codes& base, const Codes& other, const std::array<double, 4>& factors) {
    Codes result;
    for (std::size_t group = 0; group < 4; ++group)
        result.groups[group] =
            base.groups[group] + (other.groups[group] - base.groups[group]) * factors[group];
    return result;
}

}  // namespace

TEST_CASE(
    "movements of codes are told in units of the way to another face, whatever the size and scale "
    "of a group",
    "[disentanglement]") {
    const Codes base = random_codes(5, 1);
    Codes other = random_codes(5, 2);
    other.groups[1] = other.groups[1] * 50.0;
    GroupMatrix wanted{};
    std::array<Codes, 4> changed;
    for (std::size_t row = 0; row < 4; ++row) {
        for (std::size_t column = 0; column < 4; ++column)
            wanted[row][column] =
                row == column ? 1.0 : 0.05 * static_cast<double>(4 * row + column);
        changed[row] = between(base, other, wanted[row]);
    }
    wanted[0][1] = 0.3;
    changed[0] = between(base, other, wanted[0]);
    const GroupMatrix movements = group_movements(base, other, changed);
    for (std::size_t row = 0; row < 4; ++row)
        for (std::size_t column = 0; column < 4; ++column)
            CHECK(movements[row][column] == Approx(wanted[row][column]).margin(1e-5));
    CHECK(largest_leaks(movements)[0] == Approx(0.3).epsilon(1e-4));
    CHECK(largest_leaks(movements)[3] == Approx(0.7).epsilon(1e-4));
    GroupMatrix unseen = movements;
    unseen[2][2] = 0.0;
    CHECK_THROWS_AS(largest_leaks(unseen), NumericError);
}

TEST_CASE("movements of unlike rows are averaged as squares", "[disentanglement]") {
    const auto codes = [](double first, double second) {
        Codes result;
        for (std::size_t group = 0; group < 4; ++group) {
            Tensor values = Tensor::zeros({2, code_sizes[group]});
            const std::span<float> numbers = values.mutable_values<float>();
            numbers.front() = static_cast<float>(first);
            numbers.back() = static_cast<float>(second);
            result.groups[group] = values;
        }
        return result;
    };
    const GroupMatrix movements = group_movements(
        codes(0, 0), codes(6, 8), {codes(3, 4), codes(0, 5), codes(0, 0), codes(6, 8)});
    CHECK(movements[0][2] == Approx(0.5));
    CHECK(movements[1][2] == Approx(0.5));
    CHECK(movements[2][2] == 0.0);
    CHECK(movements[3][2] == Approx(1.0));
}

TEST_CASE("an encoder that reads the same of all faces has no units to measure in",
          "[disentanglement]") {
    const Codes base = random_codes(2, 1);
    CHECK_THROWS_AS(group_movements(base, base, {base, base, base, base}), NumericError);
    CHECK_THROWS_AS(group_movements(base, random_codes(1, 2), {base, base, base, base}),
                    ShapeError);
}
