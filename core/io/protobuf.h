#pragma once

#include <cstdint>
#include <string>
#include <string_view>

/// Fields of a message of protocol buffers, encoded.
namespace stymo::protobuf {

[[nodiscard]] inline std::string varint(std::uint64_t value) {
    std::string bytes;
    for (; value >= 0x80; value >>= 7) bytes += static_cast<char>((value & 0x7FU) | 0x80U);
    bytes += static_cast<char>(value);
    return bytes;
}

enum class Wire : std::uint32_t { varint = 0, fixed64 = 1, bytes = 2, fixed32 = 5 };

[[nodiscard]] inline std::string key(std::uint32_t field, Wire wire) {
    return varint((field << 3) | static_cast<std::uint32_t>(wire));
}
[[nodiscard]] inline std::string integer_field(std::uint32_t field, std::int64_t value) {
    return key(field, Wire::varint) + varint(static_cast<std::uint64_t>(value));
}
[[nodiscard]] inline std::string bytes_field(std::uint32_t field, std::string_view bytes) {
    return (key(field, Wire::bytes) + varint(bytes.size())).append(bytes);
}

}  // namespace stymo::protobuf
