#pragma once

#include <string>

namespace stymo::fuzz {

/// The bytes with the right checksum in each chunk of a PNG file. Without this, nearly every
/// changed file is refused for its checksums.
[[nodiscard]] std::string with_png_checksums(std::string bytes);

}  // namespace stymo::fuzz
