#pragma once

#include <cstdint>
#include <string_view>

namespace stymo {

/// CRC-32C (Castagnoli) of RFC 3720; zlib's crc32 uses another polynomial. `before` is the checksum
/// of the preceding bytes.
[[nodiscard]] std::uint32_t crc32c(std::string_view bytes, std::uint32_t before = 0);

}  // namespace stymo
