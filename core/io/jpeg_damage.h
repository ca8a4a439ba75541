#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace stymo {

/// Decodes a JPEG file to its last row and judges the warnings of libjpeg, of which OpenImageIO
/// reports the first alone: whether a part of the pixels is missing or invented. Wrong parameters
/// of a sequential scan, stray bytes between markers and a missing end mark lose nothing.
[[nodiscard]] bool jpeg_lost_pixels(std::string_view bytes);

/// Cyan, magenta, yellow and black of each pixel, row by row, 255 for a full ink, of a JPEG file in
/// CMYK or YCCK; empty for any other file and for a damaged one.
[[nodiscard]] std::vector<std::uint8_t> jpeg_inks(std::string_view bytes);

}  // namespace stymo
