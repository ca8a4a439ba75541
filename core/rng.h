#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// One block of Philox4x32-10 (Salmon et al. 2011), least significant word first.
[[nodiscard]] std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> counter,
                                                      std::array<std::uint32_t, 2> key);

/// Counter-based random numbers (Philox4x32-10, Salmon et al. 2011): the n-th number is a pure
/// function of key and n. Generators are passed by reference; there is no global one.
class Rng {
public:
    struct State {
        std::uint64_t key = 0;
        std::uint64_t counter = 0;
        bool operator==(const State&) const = default;
    };

    explicit Rng(std::uint64_t seed) : state_{seed, 0} {}
    explicit Rng(const State& state) : state_(state) {}

    [[nodiscard]] const State& state() const { return state_; }
    /// An independent generator for the part of the program called `name`. It does not advance this
    /// generator and does not depend on how many numbers this one has drawn.
    [[nodiscard]] Rng split(std::string_view name) const;
    /// An independent generator for item `index`, with the same properties.
    [[nodiscard]] Rng split(std::uint64_t index) const;

    /// A copy of this generator after `numbers` more draws. A draw by `below` may count as several.
    [[nodiscard]] Rng skipped(std::int64_t numbers) const;

    [[nodiscard]] std::uint64_t bits();
    /// Uniform in [0, 1), 53 random bits.
    [[nodiscard]] double uniform();
    /// Uniform in [low, high); rounding may give `high`.
    [[nodiscard]] double uniform(double low, double high) { return low + (high - low) * uniform(); }
    /// Standard normal.
    [[nodiscard]] double normal();
    /// Uniform integer in [0, bound). Throws ValueError unless `bound` is positive.
    [[nodiscard]] std::int64_t below(std::int64_t bound);

    [[nodiscard]] Tensor uniform(const Shape& shape, double low, double high,
                                 DType dtype = DType::float32);
    [[nodiscard]] Tensor normal(const Shape& shape, double mean, double deviation,
                                DType dtype = DType::float32);

private:
    State state_;
};

}  // namespace stymo
