#pragma once

#include <string_view>
#include <vector>

namespace stymo {

/// The EXIF orientation, 1 to 8, in the bytes of a WebP file, which OpenImageIO does not read;
/// 1 without one.
[[nodiscard]] int webp_orientation(std::string_view bytes);

/// Values of rows of pixels, turned and mirrored so that a picture with this EXIF orientation
/// (Exif 2.32, 4.6.4) stands upright. From 5 on, width and height change places.
[[nodiscard]] std::vector<float> turned_upright(const std::vector<float>& values, int height,
                                                int width, int channels, int orientation);

}  // namespace stymo
