#pragma once

#include <charconv>
#include <cstdint>
#include <iterator>
#include <string>

namespace stymo {

/// A number as text for files: the shortest that is read back as the same number. Unlike streams
/// and std::to_string it does not depend on the locale that a program has set.
template <class Number>
[[nodiscard]] std::string exact_text(Number value) {
    char text[64];
    const auto end = std::to_chars(std::begin(text), std::end(text), value);
    return {text, end.ptr};
}

/// In hexadecimal digits, with zeros before them up to this number of digits.
[[nodiscard]] inline std::string hexadecimal(std::uint32_t value, std::size_t digits = 1) {
    char text[8];
    const auto end = std::to_chars(std::begin(text), std::end(text), value, 16);
    const std::string shortest(text, end.ptr);
    return std::string(digits > shortest.size() ? digits - shortest.size() : 0, '0') + shortest;
}

}  // namespace stymo
