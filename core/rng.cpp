#include "core/rng.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/error.h"

namespace stymo {
namespace {

using Words = std::array<std::uint32_t, 4>;

// The last counter word keeps draws and splits apart: no draw ever computes the block that becomes
// a child's key.
constexpr std::uint32_t draw_domain = 0;
constexpr std::uint32_t name_domain = 1;
constexpr std::uint32_t index_domain = 2;

constexpr std::uint32_t low_word(std::uint64_t value) {
    return static_cast<std::uint32_t>(value);
}
constexpr std::uint32_t high_word(std::uint64_t value) {
    return static_cast<std::uint32_t>(value >> 32);
}
constexpr std::uint64_t joined(std::uint32_t low, std::uint32_t high) {
    return low | (std::uint64_t{high} << 32);
}

Words block(std::uint64_t key, std::uint64_t counter, std::uint32_t detail, std::uint32_t domain) {
    return philox4x32({low_word(counter), high_word(counter), detail, domain},
                      {low_word(key), high_word(key)});
}

double unit_interval(std::uint64_t bits) {
    return static_cast<double>(bits >> 11) * 0x1.0p-53;
}

template <class Draw>
Tensor filled(const Shape& shape, DType dtype, Draw&& draw) {
    Tensor result(shape, dtype);
    dispatch(dtype, [&](auto zero) {
        using Value = decltype(zero);
        for (Value& value : result.mutable_values<Value>()) value = draw(zero);
    });
    return result;
}

}  // namespace

std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> counter,
                                        std::array<std::uint32_t, 2> key) {
    for (int round = 0; round < 10; ++round) {
        const std::uint64_t first = std::uint64_t{0xD2511F53} * counter[0];
        const std::uint64_t second = std::uint64_t{0xCD9E8D57} * counter[2];
        counter = {high_word(second) ^ counter[1] ^ key[0], low_word(second),
                   high_word(first) ^ counter[3] ^ key[1], low_word(first)};
        key[0] += 0x9E3779B9;
        key[1] += 0xBB67AE85;
    }
    return counter;
}

Rng Rng::split(std::string_view name) const {
    std::uint64_t key = state_.key;
    // The length is mixed in with every piece, so that names with trailing zero bytes differ; the
    // empty name is one piece.
    const auto length = static_cast<std::uint32_t>(name.size());
    std::size_t begin = 0;
    do {
        std::uint64_t piece = 0;
        for (std::size_t i = begin; i < std::min(begin + 8, name.size()); ++i)
            piece = (piece << 8) | static_cast<unsigned char>(name[i]);
        const Words words = block(key, piece, length, name_domain);
        key = joined(words[0], words[1]);
        begin += 8;
    } while (begin < name.size());
    return Rng(key);
}

Rng Rng::split(std::uint64_t index) const {
    const Words words = block(state_.key, index, 0, index_domain);
    return Rng(joined(words[0], words[1]));
}

Rng Rng::skipped(std::int64_t numbers) const {
    return Rng(State{state_.key, state_.counter + static_cast<std::uint64_t>(numbers)});
}

std::uint64_t Rng::bits() {
    const Words words = block(state_.key, state_.counter++, 0, draw_domain);
    return joined(words[0], words[1]);
}

double Rng::uniform() {
    return unit_interval(bits());
}

double Rng::normal() {
    // Box-Muller from the two halves of one block: every draw takes one counter step, whatever its
    // kind.
    const Words words = block(state_.key, state_.counter++, 0, draw_domain);
    const double radius =
        std::sqrt(-2.0 * std::log(1.0 - unit_interval(joined(words[0], words[1]))));
    return radius * std::cos(2.0 * std::numbers::pi * unit_interval(joined(words[2], words[3])));
}

std::int64_t Rng::below(std::int64_t bound) {
    if (bound <= 0) {
        fail<ValueError>("[Rng::below] the bound must be positive; got ", bound);
    }
    // Values of the last, incomplete run of `divisor` would make small results more likely.
    const auto divisor = static_cast<std::uint64_t>(bound);
    const std::uint64_t limit = std::numeric_limits<std::uint64_t>::max() / divisor * divisor;
    std::uint64_t value = bits();
    while (value >= limit) value = bits();
    return static_cast<std::int64_t>(value % divisor);
}

Tensor Rng::uniform(const Shape& shape, double low, double high, DType dtype) {
    return filled(shape, dtype, [&](auto zero) {
        using Value = decltype(zero);
        const auto value = static_cast<Value>(uniform(low, high));
        // Rounding may reach `high`, which is outside the interval.
        return value < static_cast<Value>(high)
                   ? value
                   : std::max(static_cast<Value>(low),
                              std::nextafter(static_cast<Value>(high), static_cast<Value>(low)));
    });
}

Tensor Rng::normal(const Shape& shape, double mean, double deviation, DType dtype) {
    return filled(shape, dtype, [&](auto zero) {
        return static_cast<decltype(zero)>(mean + deviation * normal());
    });
}

}  // namespace stymo
