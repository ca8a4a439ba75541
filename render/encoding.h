#pragma once

#include "core/autograd/variable.h"

namespace stymo {

/// Channels of the positional encoding.
[[nodiscard]] constexpr std::int64_t encoded_channels(std::int64_t frequencies) {
    return 3 + 6 * frequencies;
}

/// Positional encoding (Mildenhall et al. 2020) without the factor pi and with x itself, in the
/// layout of HeadNeRF: (x, sin x, cos x, sin 2x, cos 2x, ..., cos 2^(frequencies-1) x), each a
/// block of three. points (..., 3) -> (..., 3 + 6 * frequencies).
[[nodiscard]] Variable positional_encoding(const Variable& points, std::int64_t frequencies);

}  // namespace stymo
