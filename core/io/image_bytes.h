#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// Throws ShapeError unless `image` is (height, width, channels) with 1 or 3 channels (or 4, if it
/// may be transparent) and at least one pixel.
void require_image(const Tensor& image, const char* operation, bool may_be_transparent = false);
/// Values clipped to [0, 1] and rounded to 0..255, row-major; NaN becomes 0.
[[nodiscard]] std::vector<std::uint8_t> image_bytes(const Tensor& image);

/// How an image is written.
struct ImageEncoding {
    std::string name;  ///< its extension selects the format
    std::int64_t height = 0;
    std::int64_t width = 0;
    std::int64_t channels = 0;
    bool floats = false;                              ///< pixels are float32; else bytes in sRGB
    std::map<std::string, std::string> attributes{};  ///< of OpenImageIO's ImageSpec
};

/// The bytes of an image file. They are encoded in memory, because OpenImageIO does not notice
/// when the disk refuses a part of a file; `write_file` does. Throws FileError if the image
/// cannot be encoded.
[[nodiscard]] std::string encoded_image(const ImageEncoding& encoding, const void* pixels);

/// Animations of frames (height, width, 3) of one size in [0, 1], encoded in memory, that repeat
/// endlessly. They throw FileError if the frames cannot be encoded.

/// All frames have one palette of 255 colours: the frames' own if they have no more, otherwise the
/// centres of a k-means clustering in which rare colours count more than their pixels. No pixel is
/// dithered.
[[nodiscard]] std::string gif_bytes(const std::vector<Tensor>& frames, double frames_per_second);
/// Lossy WebP.
[[nodiscard]] std::string webp_bytes(const std::vector<Tensor>& frames, double frames_per_second);

}  // namespace stymo
