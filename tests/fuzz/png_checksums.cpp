#include "fuzz/png_checksums.h"

#include <zlib.h>

#include <cstdint>

namespace stymo::fuzz {

std::string with_png_checksums(std::string bytes) {
    auto* const data = reinterpret_cast<Bytef*>(bytes.data());
    constexpr std::size_t signature = 8, frame = 12;  // length, type and checksum of a chunk
    for (std::size_t at = signature; at + frame <= bytes.size();) {
        std::size_t length = 0;
        for (std::size_t k = 0; k < 4; ++k) length = length << 8U | data[at + k];
        if (length > bytes.size() - at - frame) break;
        const auto checked = static_cast<uInt>(length + 4);
        const auto checksum = static_cast<std::uint32_t>(crc32(0, data + at + 4, checked));
        for (std::size_t k = 0; k < 4; ++k)
            data[at + 8 + length + k] = static_cast<Bytef>(checksum >> (24 - 8 * k));
        at += frame + length;
    }
    return bytes;
}

}  // namespace stymo::fuzz
