#include "core/io/checksum.h"

#include <array>

namespace stymo {
namespace {

constexpr std::array<std::uint32_t, 256> remainders = [] {
    constexpr std::uint32_t reflected_polynomial = 0x82F63B78;
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t byte = 0; byte < table.size(); ++byte) {
        std::uint32_t remainder = byte;
        for (int bit = 0; bit < 8; ++bit)
            remainder = (remainder >> 1) ^ ((remainder & 1U) != 0 ? reflected_polynomial : 0U);
        table[byte] = remainder;
    }
    return table;
}();

}  // namespace

std::uint32_t crc32c(std::string_view bytes, std::uint32_t before) {
    std::uint32_t remainder = ~before;
    for (const char byte : bytes)
        remainder =
            (remainder >> 8) ^ remainders[(remainder ^ static_cast<unsigned char>(byte)) & 0xFFU];
    return ~remainder;
}

}  // namespace stymo
