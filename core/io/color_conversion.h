#pragma once

#include <span>
#include <string>

#include "core/io/color_tags.h"

namespace stymo {

/// Converts the colours of pixels (red, green, blue; three times the same for a grey image) to sRGB
/// in place, colorimetrically and with black point compensation. Values may leave [0, 1]. Colours
/// whose tags mean sRGB to half a step of 8 bits stay as they are. `inks`: cyan, magenta, yellow
/// and black in [0, 1] of each pixel, or empty; with a profile of inks, the colours come from them.
/// Returns why the tags cannot be used, or an empty string; the colours then stay.
[[nodiscard]] std::string convert_to_srgb(std::span<float> pixels, std::span<const float> inks,
                                          const ColorTags& tags);

}  // namespace stymo
