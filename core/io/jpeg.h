#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// (height, width, 1 or 3), values in [0, 1] clipped and rounded to 8 bits, as the bytes of a JPEG
/// file. `quality` is from 1 to 100.
[[nodiscard]] std::string jpeg_bytes(const Tensor& image, int quality);
/// The image (height, width, 3) of the bytes of a JPEG file, in [0, 1]. Throws FileError for bytes
/// that are no whole JPEG file, and, before any pixel is read, for more than `most_pixels`.
[[nodiscard]] Tensor image_from_jpeg(std::string_view bytes, std::int64_t most_pixels);

}  // namespace stymo
