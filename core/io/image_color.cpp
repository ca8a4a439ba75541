#include "core/io/image_color.h"

#include <lcms2.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/parallel.h"

namespace stymo {
namespace {

struct CloseProfile {
    void operator()(void* profile) const { cmsCloseProfile(profile); }
};
struct DeleteTransform {
    void operator()(void* transform) const { cmsDeleteTransform(transform); }
};
struct FreeCurve {
    void operator()(cmsToneCurve* curve) const { cmsFreeToneCurve(curve); }
};
using Profile = std::unique_ptr<void, CloseProfile>;
using Transform = std::unique_ptr<void, DeleteTransform>;

constexpr std::int64_t pixels_of_a_task = 1 << 14;

/// ITU-R BT.2100, tables 4 and 5; see ColorTags::hdr.
double hdr_light(ColorTags::Hdr curve, double value) {
    constexpr double white = 203.0;  // cd/m2
    if (curve == ColorTags::Hdr::pq) {
        constexpr double m1 = 2610.0 / 16384, m2 = 2523.0 / 32, c1 = 3424.0 / 4096,
                         c2 = 2413.0 / 128, c3 = 2392.0 / 128, brightest = 10000.0;
        const double power = std::pow(value, 1.0 / m2);
        return brightest / white *
               std::pow(std::max(power - c1, 0.0) / (c2 - c3 * power), 1.0 / m1);
    }
    constexpr double a = 0.17883277, b = 1.0 - 4.0 * a, gamma = 1.2, brightest = 1000.0;
    const double c = 0.5 - a * std::log(4.0 * a);
    const double scene = value <= 0.5 ? value * value / 3.0 : (std::exp((value - c) / a) + b) / 12;
    return brightest / white * std::pow(scene, gamma);
}

cmsToneCurve* hdr_curve(ColorTags::Hdr curve) {
    std::array<float, 4096> light{};
    for (std::size_t i = 0; i < light.size(); ++i)
        light[i] = static_cast<float>(hdr_light(curve, static_cast<double>(i) / 4095.0));
    return cmsBuildTabulatedToneCurveFloat(nullptr, light.size(), light.data());
}

/// A profile of primaries and a curve.
Profile profile_of(const ColorTags& tags) {
    constexpr std::array<double, 8> srgb{0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290};
    const std::array<double, 8> p = tags.primaries.value_or(srgb);
    const double white_y = p.back();
    if (!std::ranges::all_of(p, [](double x) { return std::isfinite(x); }) || !(white_y > 0.0))
        return {};
    const cmsCIExyY white{p[6], p[7], 1.0};
    const cmsCIExyYTRIPLE colors{{p[0], p[1], 1.0}, {p[2], p[3], 1.0}, {p[4], p[5], 1.0}};
    // IEC 61966-2-1: ((value + 0.055) / 1.055)^2.4, below 0.04045 value / 12.92.
    constexpr std::array<double, 5> srgb_curve{2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92,
                                               0.04045};
    constexpr int gamma_with_linear_part = 4;
    const std::unique_ptr<cmsToneCurve, FreeCurve> curve(
        tags.hdr != ColorTags::Hdr::none ? hdr_curve(tags.hdr)
        : tags.gamma
            ? cmsBuildGamma(nullptr, *tags.gamma)
            : cmsBuildParametricToneCurve(nullptr, gamma_with_linear_part, srgb_curve.data()));
    const std::array<cmsToneCurve*, 3> curves{curve.get(), curve.get(), curve.get()};
    return Profile(cmsCreateRGBProfile(&white, &colors, curves.data()));
}

Profile profile_in(const std::string& bytes) {
    return Profile(cmsOpenProfileFromMem(bytes.data(), static_cast<cmsUInt32Number>(bytes.size())));
}

bool is_grey(std::span<const float> pixels) {
    for (std::size_t i = 0; i + 2 < pixels.size(); i += 3)
        if (pixels[i] != pixels[i + 1] || pixels[i] != pixels[i + 2]) return false;
    return true;
}

Transform transform_to_srgb(const Profile& from, cmsUInt32Number format) {
    const Profile srgb(cmsCreate_sRGBProfile());
    return Transform(cmsCreateTransform(from.get(), format, srgb.get(), TYPE_RGB_FLT,
                                        INTENT_RELATIVE_COLORIMETRIC,
                                        cmsFLAGS_NOCACHE | cmsFLAGS_BLACKPOINTCOMPENSATION));
}

bool keeps_colors(const Transform& transform) {
    constexpr int steps = 6;
    constexpr float half_a_step = 0.5F / 255.0F;
    std::vector<float> colors;
    for (int i = 0; i < steps * steps * steps; ++i)
        for (const int level : {i / (steps * steps), i / steps % steps, i % steps})
            colors.push_back(static_cast<float>(level) / static_cast<float>(steps - 1));
    std::vector<float> converted(colors.size());
    cmsDoTransform(transform.get(), colors.data(), converted.data(), steps * steps * steps);
    return std::ranges::equal(colors, converted,
                              [](float a, float b) { return std::abs(a - b) < half_a_step; });
}

}  // namespace

std::string convert_to_srgb(std::span<float> pixels, std::span<const float> inks,
                            const ColorTags& tags) {
    if (!tags.unusable.empty()) return tags.unusable;
    const bool has_profile = !tags.profile.empty();
    if (!has_profile && !tags.primaries && !tags.gamma) return {};
    const Profile profile = has_profile ? profile_in(tags.profile) : profile_of(tags);
    if (!profile)
        return has_profile ? "its colour profile is damaged" : "its colour tags are wrong";
    const cmsColorSpaceSignature space = cmsGetColorSpace(profile.get());
    const bool of_inks = space == cmsSigCmykData && !inks.empty();
    if (!of_inks && space != cmsSigRgbData && space != cmsSigGrayData)
        return "its colour profile is for another kind of image";
    // A grey profile takes the first of the three equal values.
    constexpr cmsUInt32Number first_of_three = TYPE_GRAY_FLT | EXTRA_SH(2);
    const bool grey = space == cmsSigGrayData;
    if (grey && !is_grey(pixels)) return "its colour profile is for another kind of image";
    const Transform transform = transform_to_srgb(
        profile, of_inks ? TYPE_CMYK_FLT : (grey ? first_of_three : TYPE_RGB_FLT));
    if (!transform) return "its colour profile is damaged";
    if (space == cmsSigRgbData && keeps_colors(transform)) return {};
    parallel_for(std::ssize(pixels) / 3, pixels_of_a_task,
                 [&](std::int64_t begin, std::int64_t end) {
                     const auto first = static_cast<std::size_t>(begin);
                     const auto count = static_cast<std::size_t>(end - begin);
                     float* target = pixels.data() + 3 * first;
                     std::vector<float> percent;
                     if (of_inks) {
                         for (const float ink : inks.subspan(4 * first, 4 * count))
                             percent.push_back(100.0F * ink);
                     }
                     cmsDoTransform(transform.get(), of_inks ? percent.data() : target, target,
                                    static_cast<cmsUInt32Number>(count));
                 });
    return {};
}

namespace {

using Primaries = std::array<double, 8>;

constexpr std::string_view png_begin = "\x89PNG\r\n\x1a\n";
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
    for (std::size_t at = png_begin.size(); bytes.size() - at >= 12;) {
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
    if (bytes.starts_with(png_begin)) return png_tags(bytes, std::move(profile));
    if (!profile.empty()) return {std::move(profile), {}, {}, {}};
    if (bytes.starts_with("RIFF")) return {webp_profile(bytes), {}, {}, {}};
    if (bytes.substr(0, 8).ends_with("jP  ")) return {jpeg2000_profile(bytes), {}, {}, {}};
    if (bytes.substr(0, 8).ends_with("ftyp")) return heif_tags(bytes);
    return {};
}

}  // namespace stymo
