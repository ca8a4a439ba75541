#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace stymo {

/// What an image file says about the colours of its pixels. Without any of it they are sRGB.
struct ColorTags {
    std::string profile;  ///< an ICC profile, which counts before the rest
    std::optional<std::array<double, 8>> primaries;  ///< x, y of red, green, blue, white
    std::optional<double> gamma;  ///< light = value^gamma; without it, sRGB's curve
    std::string unusable;         ///< a tag that is not understood, in words, or empty
    /// The curve, if it is one of HDR (ITU-R BT.2100), with the light of its reference white (203
    /// cd/m2, BT.2408) as 1. HLG is for a display of 1000 cd/m2, whose gamma of 1.2 each channel
    /// has for itself.
    enum class Hdr { none, pq, hlg } hdr = Hdr::none;
};

/// Adobe RGB (1998), which EXIF names by a number.
[[nodiscard]] ColorTags adobe_rgb();

/// The tags in the bytes of a file: cICP, sRGB, gAMA and cHRM of PNG (in the order of precedence of
/// the PNG specification, third edition, 4.3), the ICCP chunk of WebP, and the colr box of HEIF,
/// AVIF (ISO/IEC 23008-12, code points of ITU-T H.273) and JPEG 2000. `profile` is the ICC profile
/// that a decoder has found, or empty.
[[nodiscard]] ColorTags color_tags(std::string_view bytes, std::string profile);

/// Converts the colours of pixels (red, green, blue; three times the same for a grey image) to sRGB
/// in place, colorimetrically and with black point compensation. Values may leave [0, 1]. Colours
/// whose tags mean sRGB to half a step of 8 bits stay as they are. `inks`: cyan, magenta, yellow
/// and black in [0, 1] of each pixel, or empty; with a profile of inks, the colours come from them.
/// Returns why the tags cannot be used, or an empty string; the colours then stay.
[[nodiscard]] std::string convert_to_srgb(std::span<float> pixels, std::span<const float> inks,
                                          const ColorTags& tags);

}  // namespace stymo
