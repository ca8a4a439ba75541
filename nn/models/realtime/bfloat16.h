#pragma once

#include <bit>
#include <cstdint>

#include "core/kernels/gemm.h"

namespace stymo {

[[nodiscard]] inline kernels::BFloat16 to_bfloat16(float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    return {static_cast<std::uint16_t>((bits + 0x7fffU + ((bits >> 16) & 1U)) >> 16)};
}
[[nodiscard]] inline float to_float(kernels::BFloat16 value) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(value.bits) << 16);
}
[[nodiscard]] inline float to_float(float value) {
    return value;
}
/// To either type.
template <class T>
[[nodiscard]] T narrowed(float value) {
    if constexpr (sizeof(T) == sizeof(float)) {
        return value;
    } else {
        return to_bfloat16(value);
    }
}

}  // namespace stymo
