#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// Encodes an image (height, width, 1 or 3) as JPEG. Values are clipped to [0, 1] and rounded to 8
/// bits. `quality` is from 1 to 100.
[[nodiscard]] std::string jpeg_bytes(const Tensor& image, int quality);
/// Decodes the bytes of a JPEG file: an image (height, width, 3) in [0, 1]. Throws FileError for
/// bytes that are not a complete JPEG file, and, before any pixel is decoded, for more than
/// `most_pixels` pixels.
[[nodiscard]] Tensor image_from_jpeg(std::string_view bytes, std::int64_t most_pixels);

/// Decodes a JPEG file to its last row and judges the warnings of libjpeg, of which OpenImageIO
/// reports the first alone: whether a part of the pixels is missing or invented. Wrong parameters
/// of a sequential scan, another version of JFIF, stray bytes between markers and a missing end
/// mark lose nothing.
[[nodiscard]] bool jpeg_lost_pixels(std::string_view bytes);

/// Cyan, magenta, yellow and black of each pixel, row by row, 255 for a full ink, of a JPEG file in
/// CMYK or YCCK; empty for any other file and for a damaged one.
[[nodiscard]] std::vector<std::uint8_t> jpeg_inks(std::string_view bytes);

}  // namespace stymo
