#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// Encodes an image (height, width, 1 or 3) as JPEG. Values are clipped to [0, 1] and rounded to 8
/// bits. `quality` is from 1 to 100.
[[nodiscard]] std::string jpeg_bytes(const Tensor& image, int quality);
/// Decodes the bytes of a JPEG file: an image (height, width, 3) in [0, 1]. Throws FileError for
/// bytes that are not a complete JPEG file, and, before any pixel is decoded, for more than
/// `most_pixels` pixels.
[[nodiscard]] Tensor image_from_jpeg(std::string_view bytes, std::int64_t most_pixels);

}  // namespace stymo
