#pragma once

#include "core/autograd/variable.h"

namespace stymo {

[[nodiscard]] constexpr std::int64_t encoded_channels(std::int64_t frequencies) {
    return 3 + 6 * frequencies;
}

/// Positional encoding without pi and with the identity kept: (x, sin x, cos x, sin 2x, cos 2x,
/// ..., cos 2^(frequencies-1) x), each a block of three. points (..., 3) -> (..., 3 + 6
/// frequencies). Mildenhall et al. 2020; layout of HeadNeRF.
[[nodiscard]] Variable positional_encoding(const Variable& points, std::int64_t frequencies);

}  // namespace stymo
