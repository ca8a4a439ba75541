#include <lcms2.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/image_color.h"
#include "core/io/jpeg.h"
#include "core/io/scratch_folder.h"
#include "shared_data.h"

namespace image_color_tests {

using namespace stymo;
using Color = std::array<double, 3>;
using Matrix = std::array<Color, 3>;

/// Linear light from linear light, published in CSS Color Module Level 4, "Sample code for color
/// conversions", rounded.
const Matrix srgb_from_p3{
    {{1.224940, -0.224940, 0.0}, {-0.042057, 1.042057, 0.0}, {-0.019638, -0.078636, 1.098274}}};
const Matrix srgb_from_adobe{
    {{1.398357, -0.398357, 0.0}, {0.0, 1.0, 0.0}, {0.0, -0.042929, 1.042929}}};
const Matrix srgb_from_prophoto{{{2.034368, -0.727634, -0.306734},
                                 {-0.228826, 1.231753, -0.002927},
                                 {-0.008570, -0.153287, 1.161857}}};

double to_srgb(double light) {
    return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055;
}

double from_srgb(double value) {
    return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

Color converted(const Color& light, const Matrix& matrix) {
    Color result{};
    for (std::size_t i = 0; i < 3; ++i)
        result[i] =
            to_srgb(matrix[i][0] * light[0] + matrix[i][1] * light[1] + matrix[i][2] * light[2]);
    return result;
}

std::string profile_bytes(cmsHPROFILE profile) {
    cmsUInt32Number size = 0;
    REQUIRE(cmsSaveProfileToMem(profile, nullptr, &size));
    std::string bytes(size, '\0');
    REQUIRE(cmsSaveProfileToMem(profile, bytes.data(), &size));
    cmsCloseProfile(profile);
    return bytes;
}

std::string rgb_profile(cmsCIExyY white, const cmsCIExyYTRIPLE& primaries, double gamma) {
    // Type 4 is sRGB's curve.
    const std::array<double, 5> srgb{2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045};
    cmsToneCurve* curve = gamma > 0.0 ? cmsBuildGamma(nullptr, gamma)
                                      : cmsBuildParametricToneCurve(nullptr, 4, srgb.data());
    std::array<cmsToneCurve*, 3> curves{curve, curve, curve};
    const std::string bytes = profile_bytes(cmsCreateRGBProfile(&white, &primaries, curves.data()));
    cmsFreeToneCurve(curve);
    return bytes;
}

const cmsCIExyY d65{0.3127, 0.3290, 1.0};

std::string p3_profile() {
    return rgb_profile(d65, {{0.680, 0.320, 1.0}, {0.265, 0.690, 1.0}, {0.150, 0.060, 1.0}}, 0.0);
}

/// A profile of inks in which black alone counts: L* = 100 (1 - black).
std::string black_profile() {
    cmsHPROFILE profile = cmsCreateProfilePlaceholder(nullptr);
    cmsSetDeviceClass(profile, cmsSigOutputClass);
    cmsSetColorSpace(profile, cmsSigCmykData);
    cmsSetPCS(profile, cmsSigLabData);
    cmsStage* table = cmsStageAllocCLut16bit(nullptr, 2, 4, 3, nullptr);
    cmsStageSampleCLut16bit(
        table,
        [](const cmsUInt16Number* in, cmsUInt16Number* out, void*) {
            out[0] = static_cast<cmsUInt16Number>(0xffff - in[3]);
            out[1] = out[2] = 0x8080;
            return cmsInt32Number{1};
        },
        nullptr, 0);
    cmsPipeline* pipeline = cmsPipelineAlloc(nullptr, 4, 3);
    // A table is written between curves.
    cmsPipelineInsertStage(pipeline, cmsAT_END, cmsStageAllocToneCurves(nullptr, 4, nullptr));
    cmsPipelineInsertStage(pipeline, cmsAT_END, table);
    cmsPipelineInsertStage(pipeline, cmsAT_END, cmsStageAllocToneCurves(nullptr, 3, nullptr));
    cmsSetProfileVersion(profile, 4.3);
    REQUIRE(cmsWriteTag(profile, cmsSigAToB0Tag, pipeline));
    cmsPipelineFree(pipeline);
    return profile_bytes(profile);
}

std::string grey_profile(double gamma) {
    cmsToneCurve* curve = cmsBuildGamma(nullptr, gamma);
    const std::string bytes = profile_bytes(cmsCreateGrayProfile(cmsD50_xyY(), curve));
    cmsFreeToneCurve(curve);
    return bytes;
}

std::string with_profile(const std::string& jpeg, const std::string& profile) {
    const std::size_t length = 2 + 14 + profile.size();
    std::string segment("\xff\xe2", 2);
    segment += static_cast<char>(length >> 8);
    segment += static_cast<char>(length & 0xff);
    segment += std::string("ICC_PROFILE\0\x01\x01", 14) + profile;
    return jpeg.substr(0, 2) + segment + jpeg.substr(2);
}

std::vector<float> pixel(const Color& color) {
    return {color.begin(), color.end()};
}

void check_color(std::span<const float> actual, const Color& expected, double margin) {
    for (std::size_t i = 0; i < 3; ++i) CHECK(actual[i] == Approx(expected[i]).margin(margin));
}

std::string big_endian(std::uint32_t value, int bytes) {
    std::string result;
    for (int i = bytes; i-- > 0;) result += static_cast<char>(value >> (8 * i) & 0xff);
    return result;
}

std::string box(const std::string& type, const std::string& contents) {
    return big_endian(static_cast<std::uint32_t>(contents.size() + 8), 4) + type + contents;
}

std::string png_with(const std::string& type, const std::string& data) {
    return "\x89PNG\r\n\x1a\n" + box("IHDR", std::string(13, '\0')).replace(3, 1, 1, '\x0d') +
           "sums" +
           box(type, data).replace(0, 4, big_endian(static_cast<std::uint32_t>(data.size()), 4)) +
           "sums" + std::string("\0\0\0\0IDATsums", 12);
}

}  // namespace image_color_tests

using namespace image_color_tests;

TEST_CASE("colours are converted to sRGB as the published matrices of their spaces say") {
    const Color value{0.8, 0.5, 0.3};
    const Color srgb_light{from_srgb(0.8), from_srgb(0.5), from_srgb(0.3)};
    const auto power = [&](double gamma) {
        return Color{std::pow(0.8, gamma), std::pow(0.5, gamma), std::pow(0.3, gamma)};
    };
    const cmsCIExyY d50 = *cmsD50_xyY();
    struct Case {
        const char* name;
        ColorTags tags;
        Color expected;
    };
    const std::vector<Case> cases{
        {"Display P3", {p3_profile(), {}, {}, {}}, converted(srgb_light, srgb_from_p3)},
        {"Adobe RGB",
         {rgb_profile(d65, {{0.64, 0.33, 1.0}, {0.21, 0.71, 1.0}, {0.15, 0.06, 1.0}}, 563.0 / 256),
          {},
          {},
          {}},
         converted(power(563.0 / 256), srgb_from_adobe)},
        {"Adobe RGB by its number in EXIF", adobe_rgb(),
         converted(power(563.0 / 256), srgb_from_adobe)},
        {"ProPhoto",
         {rgb_profile(d50, {{0.7347, 0.2653, 1.0}, {0.1596, 0.8404, 1.0}, {0.0366, 0.0001, 1.0}},
                      1.8),
          {},
          {},
          {}},
         converted(power(1.8), srgb_from_prophoto)},
        {"a gamma alone",
         {{}, {}, 1.8, {}},
         {to_srgb(std::pow(0.8, 1.8)), to_srgb(std::pow(0.5, 1.8)), to_srgb(std::pow(0.3, 1.8))}},
        {"nothing", {}, value}};
    for (const Case& item : cases) {
        INFO(item.name);
        std::vector<float> colors = pixel(value);
        CHECK(convert_to_srgb(colors, {}, item.tags).empty());
        check_color(colors, item.expected, 0.2 / 255.0);
    }
    const ColorTags grey{grey_profile(1.8), {}, {}, {}};
    const double light = to_srgb(std::pow(0.8, 1.8));
    std::vector<float> colors = pixel({0.8, 0.8, 0.8});
    CHECK(convert_to_srgb(colors, {}, grey).empty());
    check_color(colors, {light, light, light}, 0.2 / 255.0);
    colors = pixel(value);
    CHECK(convert_to_srgb(colors, {}, grey) == "its colour profile is for another kind of image");
    check_color(colors, value, 1e-7);
    const ColorTags no_light{{}, std::array{0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3, 0.0}, {}, {}};
    CHECK(convert_to_srgb(colors, {}, no_light) == "its colour tags are wrong");
}

TEST_CASE("PQ and HLG are converted to sRGB with the reference white of BT.2408 as white") {
    const std::array<double, 8> bt2020{0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290};
    const auto check = [&](ColorTags::Hdr curve, const Color& value, const Color& light) {
        std::vector<float> colors = pixel(value);
        CHECK(convert_to_srgb(colors, {}, {{}, bt2020, {}, {}, curve}).empty());
        check_color(colors, {to_srgb(light[0]), to_srgb(light[1]), to_srgb(light[2])}, 0.4 / 255.0);
    };
    const auto grey = [](double value) { return Color{value, value, value}; };
    // BT.2408, table 1: 203 cd/m2 are 58.06 percent in PQ and 75 percent in HLG; BT.2100: 100 cd/m2
    // are 50.81 percent in PQ, and a twelfth of the scene's light is a half in HLG.
    check(ColorTags::Hdr::pq, grey(0.580689), grey(1.0));
    check(ColorTags::Hdr::pq, grey(0.508078), grey(100.0 / 203.0));
    check(ColorTags::Hdr::pq, grey(0.0), grey(0.0));
    check(ColorTags::Hdr::hlg, grey(0.5), grey(1000.0 / 203.0 * std::pow(1.0 / 12.0, 1.2)));
    // Skin in PQ, 100, 50 and 30 cd/m2, by the matrix of BT.2087.
    const Color skin{100.0 / 203.0, 50.0 / 203.0, 30.0 / 203.0};
    check(ColorTags::Hdr::pq, {0.508078, 0.440282, 0.392876},
          {1.6605 * skin[0] - 0.5876 * skin[1] - 0.0728 * skin[2],
           -0.1246 * skin[0] + 1.1329 * skin[1] - 0.0083 * skin[2],
           -0.0182 * skin[0] - 0.1006 * skin[1] + 1.1187 * skin[2]});
    std::vector<float> white = pixel(grey(0.75));
    CHECK(convert_to_srgb(white, {}, {{}, bt2020, {}, {}, ColorTags::Hdr::hlg}).empty());
    CHECK(white[0] == Approx(1.0).margin(0.01));
}

TEST_CASE("pixels whose profile is that of sRGB keep their bits") {
    cmsHPROFILE srgb = cmsCreate_sRGBProfile();
    std::vector<float> colors{0.123F, 0.456F, 0.789F};
    const std::vector<float> before = colors;
    CHECK(convert_to_srgb(colors, {}, {profile_bytes(srgb), {}, {}, {}}).empty());
    CHECK(colors == before);
}

TEST_CASE("inks become colours by their profile, and not without inks") {
    // CIE 1976: above 8, Y = ((L + 16) / 116)^3.
    const double grey = to_srgb(std::pow((60.0 + 16.0) / 116.0, 3.0));
    std::vector<float> colors = pixel({0.1, 0.2, 0.3});
    const std::vector<float> inks{0.3F, 0.7F, 0.0F, 0.4F};
    const ColorTags tags{black_profile(), {}, {}, {}};
    CHECK(convert_to_srgb(colors, inks, tags).empty());
    check_color(colors, {grey, grey, grey}, 0.5 / 255.0);
    CHECK(convert_to_srgb(colors, {}, tags) == "its colour profile is for another kind of image");
}

TEST_CASE("a JPEG in Display P3 or in CMYK is read as sRGB, and what cannot be used is said") {
    const ScratchFolder folder;
    const Color value{0.8, 0.5, 0.3};
    std::vector<float> flat;
    for (int i = 0; i < 256; ++i) flat.insert(flat.end(), value.begin(), value.end());
    write_image(folder / "flat.jpg", Tensor::from({16, 16, 3}, std::span<const float>(flat)));
    const std::string plain = read_file(folder / "flat.jpg");
    const auto read = [&](const std::string& bytes, std::string& doubt) {
        write_file(folder / "tagged.jpg", bytes);
        return read_image(folder / "tagged.jpg", usual_most_pixels, &doubt);
    };
    std::string doubt = "former";
    const Tensor p3 = read(with_profile(plain, p3_profile()), doubt);
    CHECK(doubt.empty());
    const Color light{from_srgb(0.8), from_srgb(0.5), from_srgb(0.3)};
    constexpr double rounding = 2.5 / 255.0;  // of JPEG
    check_color(p3.values<float>(), converted(light, srgb_from_p3), rounding);
    const Tensor mask = read_mask(folder / "tagged.jpg");
    CHECK(mask.values<float>()[0] ==
          Approx(0.299 * 0.8 + 0.587 * 0.5 + 0.114 * 0.3).margin(rounding));

    const Tensor same = read(with_profile(plain, p3_profile().substr(0, 100)), doubt);
    CHECK(doubt == "its colour profile is damaged; its colours are taken as sRGB");
    check_color(same.values<float>(), value, rounding);

    const std::string ink =
        read_file(std::filesystem::path(STYMO_SOURCE_DIR) / "tests/golden/images/cmyk.jpg");
    const Tensor black = read(with_profile(ink, black_profile()), doubt);
    CHECK(doubt.empty());
    // Its first pixel has 63 of 255 parts of black, by Pillow.
    const double grey = to_srgb(std::pow((100.0 - 100.0 * 63.0 / 255.0 + 16.0) / 116.0, 3.0));
    check_color(black.values<float>(), {grey, grey, grey}, rounding);
}

TEST_CASE("a JPEG whose EXIF has DCF's name of Adobe RGB is read as such", "[image]") {
    const std::array<double, 3> values{0.7, 0.5, 0.4};
    Color light{};
    std::ranges::transform(values, light.begin(),
                           [](double value) { return std::pow(value, 563.0 / 256); });
    Tensor image({16, 16, 3});
    for (std::size_t i = 0; i < 16 * 16 * 3; ++i)
        image.mutable_values<float>()[i] = static_cast<float>(values[i % 3]);
    const auto entry = [&](std::uint32_t tag, std::uint32_t type, std::uint32_t count,
                           const std::string& value) {
        return big_endian(tag, 2) + big_endian(type, 2) + big_endian(count, 4) + value;
    };
    const auto directory = [&](std::uint32_t entries, const std::string& bytes) {
        return big_endian(entries, 2) + bytes + big_endian(0, 4);
    };
    using namespace std::string_literals;
    for (const std::string& name : {"R03\0"s, "R98\0"s}) {
        const std::string tiff = "MM\0*"s + big_endian(8, 4) +
                                 directory(1, entry(0x8769, 4, 1, big_endian(26, 4))) +
                                 directory(2, entry(0xa001, 3, 1, big_endian(0xffff0000, 4)) +
                                                  entry(0xa005, 4, 1, big_endian(56, 4))) +
                                 directory(1, entry(1, 2, 4, name));
        const std::string exif = "Exif\0\0"s + tiff;
        const ScratchFolder folder;
        const auto size = static_cast<char>(exif.size() + 2);
        write_file(folder / "photo.jpg",
                   jpeg_bytes(image, 100).insert(2, "\xff\xe1\0"s + size + exif));
        const Tensor read = read_image(folder / "photo.jpg");
        const Color expected = name[1] == '0' ? converted(light, srgb_from_adobe) : values;
        for (std::size_t c = 0; c < 3; ++c)
            CHECK(read.values<float>()[c] == Approx(expected[c]).margin(0.006));
    }
}

TEST_CASE("light in an EXR file is read by sRGB's curve, and masks as they are") {
    const ScratchFolder folder;
    const std::vector<float> values{0.25F, 0.001F, 7.5F};
    write_exr(folder / "light.exr", Tensor::from({1, 1, 3}, std::span<const float>(values)));
    check_color(read_image(folder / "light.exr").values<float>(),
                {to_srgb(0.25), to_srgb(0.001), 1.0}, 1e-4);
    write_exr(folder / "grey.exr", Tensor::full({1, 1, 1}, 0.25));
    const double grey = to_srgb(0.25);
    check_color(read_image(folder / "grey.exr").values<float>(), {grey, grey, grey}, 1e-4);
    CHECK(read_mask(folder / "light.exr").values<float>()[0] ==
          Approx(0.299 * 0.25 + 0.587 * 0.001 + 0.114));
}

TEST_CASE("the colour tags of PNG are read in the order of their precedence") {
    const auto tags = [](const std::string& type, const std::string& data) {
        return color_tags(png_with(type, data), "profile");
    };
    CHECK(tags("tEXt", "").profile == "profile");
    CHECK(tags("cICP", std::string("\x0c\x0d\0\x01", 4)).profile.empty());
    CHECK(tags("cICP", std::string("\x0c\x0d\0\x01", 4)).primaries.value()[0] == 0.680);
    CHECK(tags("cICP", std::string("\x09\x10\0\x01", 4)).hdr == ColorTags::Hdr::pq);
    CHECK(tags("cICP", std::string("\x09\x12\0\x01", 4)).hdr == ColorTags::Hdr::hlg);
    CHECK(tags("cICP", std::string("\x09\x11\0\x01", 4)).unusable == "the transfer function 17");
    CHECK(tags("gAMA", big_endian(100000, 4)).gamma == Approx(1.0));
    CHECK_FALSE(tags("gAMA", big_endian(45455, 4)).gamma);
    CHECK_FALSE(tags("gAMA", big_endian(0, 4)).gamma);
    CHECK(tags("sRGB", std::string(1, '\0')).profile == "profile");
    std::string primaries;
    for (const std::uint32_t value :
         {31270U, 32900U, 64000U, 33000U, 21000U, 71000U, 15000U, 6000U})
        primaries += big_endian(value, 4);
    CHECK(tags("cHRM", primaries).primaries == adobe_rgb().primaries);
}

TEST_CASE("the colour boxes of HEIF, AVIF and JPEG 2000 and the profile of WebP are found") {
    const std::string codes = "nclx" + big_endian(12, 2) + big_endian(13, 2) + big_endian(1, 2);
    const auto heif = [](const std::string& properties) {
        return box("ftyp", "heic") +
               box("meta", std::string(4, '\0') + box("hdlr", "") +
                               box("iprp", box("ipco", box("ispe", "size") + properties))) +
               box("mdat", "colr");
    };
    const ColorTags by_codes = color_tags(heif(box("colr", codes) + box("pixi", "x")), {});
    CHECK(by_codes.primaries.value()[2] == 0.265);
    CHECK_FALSE(by_codes.gamma);
    const ColorTags by_profile =
        color_tags(heif(box("colr", codes) + box("colr", "profPROFILE")), {});
    CHECK(by_profile.profile == "PROFILE");
    CHECK_FALSE(by_profile.primaries);
    CHECK(color_tags(heif(""), {}).profile.empty());
    const std::string whole = heif(box("colr", codes));
    for (std::size_t length = 0; length < whole.size(); ++length)
        static_cast<void>(color_tags(whole.substr(0, length), {}));

    const std::string jp2 =
        box("jP  ", "....") + box("jp2h", box("ihdr", "") + box("colr", "\x02..PROFILE"));
    CHECK(color_tags(jp2, {}).profile == "PROFILE");
    const std::string webp =
        std::string("RIFF\0\0\0\0WEBPVP8X\x01\0\0\0x\0ICCP\x07\0\0\0PROFILE", 37);
    CHECK(color_tags(webp, {}).profile == "PROFILE");
}

TEST_CASE("photos in Display P3 and Adobe RGB have the mean colour of their original") {
    const auto folder = shared_data("cases/icc");
    if (!folder) return;
    const auto mean = [&](const char* name) {
        const Tensor image = read_image(*folder / name);
        Color sums{};
        const auto values = image.values<float>();
        for (std::size_t i = 0; i < values.size(); ++i) sums[i % 3] += values[i];
        for (double& sum : sums) sum *= 3.0 / static_cast<double>(values.size());
        return sums;
    };
    const Color original = mean("base.png");
    for (const char* name : {"p3.jpg", "adobe.jpg"}) {
        INFO(name);
        const Color color = mean(name);
        for (std::size_t i = 0; i < 3; ++i)
            CHECK(color[i] == Approx(original[i]).margin(1.0 / 255.0));
    }
}
