#include "core/io/color_tags.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace stymo {
namespace {

using Primaries = std::array<double, 8>;

constexpr std::string_view png_signature = "\x89PNG\r\n\x1a\n";
constexpr double adobe_gamma = 2.19921875;
/// The gamma that stands for sRGB's curve in PNG files, and how far others may be from it.
constexpr double srgb_png_gamma = 0.45455, gamma_tolerance = 0.005;

/// A big-endian number of `count` bytes.
std::uint32_t number(std::string_view bytes, std::size_t at, std::size_t count) {
    std::uint32_t value = 0;
    for (const char byte : bytes.substr(at, count))
        value = (value << 8) | static_cast<unsigned char>(byte);
    return value;
}

/// Colour primaries of ITU-T H.273, table 2; those of sRGB for the code "unspecified".
std::optional<Primaries> primaries_of_code(std::uint32_t code) {
    constexpr double x = 0.3127, y = 0.3290;  // D65
    switch (code) {
        case 1:
        case 2: return Primaries{0.64, 0.33, 0.30, 0.60, 0.15, 0.06, x, y};
        case 5: return Primaries{0.64, 0.33, 0.29, 0.60, 0.15, 0.06, x, y};
        case 6:
        case 7: return Primaries{0.630, 0.340, 0.310, 0.595, 0.155, 0.070, x, y};
        case 9: return Primaries{0.708, 0.292, 0.170, 0.797, 0.131, 0.046, x, y};
        case 12: return Primaries{0.680, 0.320, 0.265, 0.690, 0.150, 0.060, x, y};
        default: return std::nullopt;
    }
}

/// Code points of ITU-T H.273. BT.709's curve is that of a camera; images that name it are made
/// for screens, whose curve is sRGB's.
ColorTags tags_of_codes(std::uint32_t primaries, std::uint32_t transfer) {
    ColorTags tags;
    tags.primaries = primaries_of_code(primaries);
    switch (transfer) {
        case 1:
        case 2:
        case 6:
        case 13:
        case 14:
        case 15: break;
        case 4: tags.gamma = 2.2; break;
        case 5: tags.gamma = 2.8; break;
        case 8: tags.gamma = 1.0; break;
        case 16: tags.hdr = ColorTags::Hdr::pq; break;
        case 18: tags.hdr = ColorTags::Hdr::hlg; break;
        default: tags.unusable = "the transfer function " + std::to_string(transfer);
    }
    if (!tags.primaries) tags.unusable = "the colour primaries " + std::to_string(primaries);
    return tags;
}

ColorTags png_tags(std::string_view bytes, std::string profile) {
    ColorTags tags{std::move(profile), {}, {}, {}};
    bool is_srgb = false;
    for (std::size_t at = png_signature.size(); bytes.size() - at >= 12;) {
        const std::size_t length = number(bytes, at, 4);
        const std::string_view type = bytes.substr(at + 4, 4);
        if (type == "IDAT" || bytes.size() - at - 12 < length) break;
        const std::string_view data = bytes.substr(at + 8, length);
        if (type == "cICP" && length == 4)
            return tags_of_codes(number(data, 0, 1), number(data, 1, 1));
        is_srgb = is_srgb || type == "sRGB";
        const auto fraction = [&](std::size_t index) { return number(data, 4 * index, 4) / 1e5; };
        if (type == "gAMA" && length == 4 && fraction(0) > 0.0 &&
            std::abs(fraction(0) - srgb_png_gamma) > gamma_tolerance)
            tags.gamma = 1.0 / fraction(0);
        if (type == "cHRM" && length == 32)
            tags.primaries = Primaries{fraction(2), fraction(3), fraction(4), fraction(5),
                                       fraction(6), fraction(7), fraction(0), fraction(1)};
        at += length + 12;
    }
    if (is_srgb) return {std::move(tags.profile), {}, {}, {}};
    return tags;
}

std::string webp_profile(std::string_view bytes) {
    for (std::size_t at = 12; bytes.size() >= at + 8;) {
        std::size_t length = 0;
        for (std::size_t i = 4; i-- > 0;)
            length = (length << 8) | static_cast<unsigned char>(bytes[at + 4 + i]);
        if (bytes.substr(at, 4) == "ICCP") return std::string(bytes.substr(at + 8, length));
        at += 8 + length + length % 2;
    }
    return {};
}

/// The contents of the box of this type among the boxes of a file or of another box.
std::string_view box(std::string_view boxes, std::string_view type) {
    while (boxes.size() >= 8) {
        const std::size_t size = number(boxes, 0, 4);
        const std::size_t whole = size == 0 ? boxes.size() : size;
        if (whole < 8 || whole > boxes.size()) break;
        if (boxes.substr(4, 4) == type) return boxes.substr(8, whole - 8);
        boxes.remove_prefix(whole);
    }
    return {};
}

/// Of several images, such as a photo and its depth, the first is the one that is shown; a profile
/// says more than code points.
ColorTags heif_tags(std::string_view bytes) {
    constexpr std::size_t version_and_flags = 4;
    std::string_view meta = box(bytes, "meta");
    meta.remove_prefix(std::min(version_and_flags, meta.size()));
    std::string_view properties = box(box(meta, "iprp"), "ipco");
    ColorTags codes;
    bool found = false;
    while (true) {
        const std::string_view color = box(properties, "colr");
        if (color.size() < 4) return codes;
        const std::string_view kind = color.substr(0, 4);
        if (kind == "prof" || kind == "rICC") return {std::string(color.substr(4)), {}, {}, {}};
        if (kind == "nclx" && color.size() >= 8 && !found) {
            codes = tags_of_codes(number(color, 4, 2), number(color, 6, 2));
            found = true;
        }
        properties.remove_prefix(
            static_cast<std::size_t>(color.data() + color.size() - properties.data()));
    }
}

std::string jpeg2000_profile(std::string_view bytes) {
    constexpr std::size_t header = 3;  // method, precedence, approximation
    const std::string_view color = box(box(bytes, "jp2h"), "colr");
    const bool has_profile = color.size() > header && (color[0] == 2 || color[0] == 3);
    return has_profile ? std::string(color.substr(header)) : std::string();
}

}  // namespace

ColorTags adobe_rgb() {
    return {{}, Primaries{0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290}, adobe_gamma, {}};
}

ColorTags color_tags(std::string_view bytes, std::string profile) {
    if (bytes.starts_with(png_signature)) return png_tags(bytes, std::move(profile));
    if (!profile.empty()) return {std::move(profile), {}, {}, {}};
    if (bytes.starts_with("RIFF")) return {webp_profile(bytes), {}, {}, {}};
    if (bytes.substr(0, 8).ends_with("jP  ")) return {jpeg2000_profile(bytes), {}, {}, {}};
    if (bytes.substr(0, 8).ends_with("ftyp")) return heif_tags(bytes);
    return {};
}

}  // namespace stymo
