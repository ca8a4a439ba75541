#include "core/io/color_conversion.h"

#include <lcms2.h>

#include <algorithm>
#include <array>
#include <cmath>
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

}  // namespace stymo
