#include <png.h>
#include <sys/resource.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/rng.h"
#include "shared_data.h"

using namespace stymo;
using Catch::Matchers::Contains;

namespace {

std::filesystem::path golden(const std::string& name) {
    return std::filesystem::path(STYMO_SOURCE_DIR) / "tests/golden/images" / name;
}

void check_values(const Tensor& actual, const Shape& shape, const std::vector<double>& expected,
                  double scale = 1.0) {
    REQUIRE(actual.shape() == shape);
    const std::vector<double> values = actual.to_vector();
    for (std::size_t i = 0; i < expected.size(); ++i) {
        CHECK(values[i] * scale == Approx(expected[i]).margin(1e-4));
    }
}

Tensor random_image(std::int64_t height, std::int64_t width, std::int64_t channels) {
    return Rng(1).uniform({height, width, channels}, 0.0, 1.0);
}

double largest_difference(const Tensor& left, const Tensor& right) {
    REQUIRE(left.shape() == right.shape());
    const std::vector<double> a = left.to_vector();
    const std::vector<double> b = right.to_vector();
    double largest = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        largest = std::max(largest, std::abs(a[i] - b[i]));
    }
    return largest;
}

}  // namespace

TEST_CASE("class maps are read as indices, not as colours") {
    check_values(read_class_map(golden("palette_8bit.png")), {2, 3, 1}, {0, 1, 2, 3, 3, 0});
    check_values(read_class_map(golden("palette_2bit.png")), {1, 4, 1}, {0, 1, 2, 3});
    check_values(read_class_map(golden("palette_transparent.png")), {2, 3, 1}, {0, 1, 2, 3, 3, 0});
    check_values(read_class_map(golden("grey_8bit.png")), {1, 3, 1}, {0, 18, 255});
}

TEST_CASE("the class maps of CelebAMask-HQ hold its 19 classes") {
    const auto path = shared_data("data/celebamask/parsing/00000.png");
    if (!path) return;
    const Tensor classes = read_class_map(*path);
    CHECK(classes.shape() == Shape{512, 512, 1});
    std::set<float> seen;
    for (const float value : classes.values<float>()) {
        seen.insert(value);
    }
    CHECK(*seen.begin() == 0.0F);
    CHECK(*seen.rbegin() <= 18.0F);
    CHECK(seen.contains(1.0F));  // skin
    CHECK(seen.contains(2.0F));  // nose
}

TEST_CASE("images that are no class maps are refused as such") {
    CHECK_THROWS_WITH(read_class_map(golden("rgba.png")), Contains("not a class map"));
    CHECK_THROWS_WITH(read_class_map(golden("rgb_16bit.png")), Contains("not a class map"));
    CHECK_THROWS_WITH(read_class_map(golden("grey_alpha.png")), Contains("not a class map"));
    const ScratchFolder folder;
    write_image(folder / "a.jpg", random_image(8, 8, 1));
    CHECK_THROWS_WITH(read_class_map(folder / "a.jpg"), Contains("not a PNG image"));
}

TEST_CASE("every kind of PNG becomes RGB between 0 and 1") {
    check_values(read_image(golden("palette_8bit.png")), {2, 3, 3},
                 {0, 0, 0, 204, 0, 0, 76, 153, 0, 204, 0, 0, 204, 0, 0, 0, 0, 0}, 255.0);
    check_values(read_image(golden("grey_8bit.png")), {1, 3, 3},
                 {0, 0, 0, 18, 18, 18, 255, 255, 255}, 255.0);
    check_values(read_image(golden("grey_alpha.png")), {1, 2, 3}, {200, 200, 200, 40, 40, 40},
                 255.0);
    check_values(read_image(golden("rgba.png")), {1, 2, 3}, {255, 100, 0, 51, 20, 0}, 255.0);
    check_values(read_image(golden("rgb_16bit.png")), {1, 1, 3}, {1, 32768, 65535}, 65535.0);
}

TEST_CASE("a PNG with an orientation is turned upright") {
    check_values(read_image(golden("turned.png")), {2, 2, 3}, {0, 0, 1, 1, 0, 0, 1, 1, 1, 0, 1, 0});
}

TEST_CASE("a WebP is turned upright by each of the eight orientations") {
    const ScratchFolder folder;
    // 0, 40, 80 over 120, 160, 200, written losslessly by Pillow; the last number but six bytes is
    // the orientation.
    std::string bytes(
        "RIFF\x62\0\0\0WEBPVP8X\x0a\0\0\0\x08\0\0\0\x02\0\0\x01\0\0VP8L\x22\0\0\0\x2f\x02\x40\0\0"
        "\x2f\x20\x10\x48\xc2\xd9\x5f\x71\x89\x41\x19\x94\xf9\x4f\x6c\x43\x4d\xdb\x06\x6c\xa8"
        "\xf3\x2f\xa7\x46\xf4\x3f\xa6\x17"
        "EXIF\x1a\0\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x08\0\0\0\0\0\0",
        106);
    // Pillow's ImageOps.exif_transpose.
    const std::vector<std::vector<double>> upright{
        {0, 40, 80, 120, 160, 200}, {80, 40, 0, 200, 160, 120}, {200, 160, 120, 80, 40, 0},
        {120, 160, 200, 0, 40, 80}, {0, 120, 40, 160, 80, 200}, {120, 0, 160, 40, 200, 80},
        {200, 80, 160, 40, 120, 0}, {80, 200, 40, 160, 0, 120}};
    for (std::size_t i = 0; i < upright.size(); ++i) {
        bytes[bytes.size() - 7] = static_cast<char>(i + 1);
        write_file(folder / "a.webp", bytes);
        const bool on_its_side = i >= 4;
        std::vector<double> expected;
        for (const double value : upright[i]) expected.insert(expected.end(), 3, value);
        check_values(read_image(folder / "a.webp"), {on_its_side ? 3 : 2, on_its_side ? 2 : 3, 3},
                     expected, 255.0);
    }
}

TEST_CASE("a JPEG with an orientation is turned upright") {
    const ScratchFolder folder;
    std::vector<float> values(16 * 8 * 3, 0.0F);
    for (std::size_t i = 0; i < 16UL * 8 * 3; ++i) {
        values[i] = i / 3 % 16 < 8 ? 1.0F : 0.0F;  // 8 rows of 16: the left half is white
    }
    write_image(folder / "flat.jpg", Tensor::from({8, 16, 3}, std::span<const float>(values)));
    const std::string flat = read_file(folder / "flat.jpg");
    const std::string exif(
        "\xff\xe1\x00\x22"
        "Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0",
        36);
    write_file(folder / "turned.jpg", flat.substr(0, 2) + exif + flat.substr(2));
    const Tensor turned = read_image(folder / "turned.jpg");
    REQUIRE(turned.shape() == Shape{16, 8, 3});
    for (std::int64_t i = 0; i < turned.size(); ++i) {
        CHECK(turned.values<float>()[static_cast<std::size_t>(i)] ==
              Approx(i < 8 * 8 * 3 ? 1.0 : 0.0).margin(0.02));
    }
}

TEST_CASE("a quarter turn brings the first column up, and four of them nothing") {
    const std::vector<double> values{1, 2, 3, 4, 5, 6};
    const Tensor image =
        Tensor::from({2, 3, 1}, std::span<const double>(values)).to(DType::float32);
    check_values(turned_image(image, 1), {3, 2, 1}, {4, 1, 5, 2, 6, 3});
    check_values(turned_image(image, 2), {2, 3, 1}, {6, 5, 4, 3, 2, 1});
    check_values(turned_image(image, -1), {3, 2, 1}, {3, 6, 2, 5, 1, 4});
    check_values(turned_image(image, 4), {2, 3, 1}, values);
}

TEST_CASE("a mask is grey as it is and colour as its luminance") {
    check_values(read_mask(golden("grey_8bit.png")), {1, 3, 1}, {0, 18, 255}, 255.0);
    check_values(read_mask(golden("turned.png")), {2, 2, 1}, {0.114, 0.299, 1.0, 0.587});
}

TEST_CASE("an image comes back from PNG to half a step and from JPEG closely") {
    const ScratchFolder folder;
    for (const std::int64_t channels : {1, 3}) {
        const Tensor image = random_image(7, 5, channels);
        write_image(folder / "a.png", image);
        const Tensor read =
            channels == 1 ? read_mask(folder / "a.png") : read_image(folder / "a.png");
        CHECK(largest_difference(read, image) < 0.5 / 255.0 + 1e-6);
    }
    const Tensor flat = Tensor::full({16, 16, 3}, 0.4);
    write_image(folder / "a.jpg", flat);
    CHECK(largest_difference(read_image(folder / "a.jpg"), flat) < 2.0 / 255.0);
    CHECK(folder.file_count() == 2);
}

TEST_CASE("written values are clipped, and what is not a number is black") {
    const ScratchFolder folder;
    const std::vector<double> values = {-0.5, 1.5, std::numeric_limits<double>::quiet_NaN()};
    write_image(folder / "a.png", Tensor::from({1, 1, 3}, std::span<const double>(values)));
    check_values(read_image(folder / "a.png"), {1, 1, 3}, {0.0, 1.0, 0.0});
}

TEST_CASE("float files keep their bytes and are clipped when read as images") {
    const ScratchFolder folder;
    const std::vector<float> values = {-2.0F, 0.25F, 7.5F};
    write_exr(folder / "colour.exr", Tensor::from({1, 1, 3}, std::span<const float>(values)));
    // sRGB's curve: 1.055 * 0.25^(1 / 2.4) - 0.055.
    check_values(read_image(folder / "colour.exr"), {1, 1, 3}, {0.0, 0.537099, 1.0});
    write_exr(folder / "depth.exr", Tensor::full({2, 3, 1}, 0.75));
    check_values(read_mask(folder / "depth.exr"), {2, 3, 1}, std::vector<double>(6, 0.75));
    const std::string bytes = read_file(folder / "depth.exr");
    CHECK(bytes.find(std::string("Y\0\x02\0\0\0", 6)) !=
          std::string::npos);  // channel Y of 32-bit floats
}

TEST_CASE("what is not a readable image is refused in one line that says why") {
    const ScratchFolder folder;
    const auto refused = [&](const std::string& name, const std::string& bytes,
                             const std::string& reason) {
        std::ofstream(folder / name, std::ios::binary) << bytes;
        try {
            static_cast<void>(read_image(folder / name));
            FAIL(name << " was read");
        } catch (const FileError& error) {
            const std::string message = error.what();
            CHECK_THAT(message, Contains(name) && Contains(reason));
            CHECK(message.find('\n') == std::string::npos);
        }
    };
    write_image(folder / "whole.png", random_image(32, 32, 3));
    write_image(folder / "whole.jpg", random_image(32, 32, 3));
    const std::string png = read_file(folder / "whole.png");
    const std::string jpg = read_file(folder / "whole.jpg");
    std::string damaged = png;
    damaged[damaged.size() / 2] ^= 1;

    refused("empty.jpg", "", "not an image (zero bytes)");
    refused("text.png", "hello, world", "not an image");
    refused("text.jpg", "hello, world", "not an image");
    refused("text.unknown", "hello, world", "not an image");
    refused("cut.png", png.substr(0, png.size() / 2), "truncated");
    refused("head.png", png.substr(0, 20), "truncated");
    refused("signature.png", png.substr(0, 8), "truncated");
    refused("damaged.png", damaged, "damaged");
    refused("cut.jpg", jpg.substr(0, jpg.size() / 2), "Premature end");
    refused("cut.webp", "RIFF....WEBPVP8 ", "damaged image");
    CHECK_THROWS_WITH(read_image("/dev/null"), Contains("is no file"));
    CHECK_THROWS_WITH(read_image(folder / "none.png"), Contains("No such file"));
    CHECK_THROWS_AS(read_image(folder.path()), FileError);
}

TEST_CASE("a JPEG in CMYK, the first image of an animation and a single pixel are read as RGB") {
    const Tensor ink = read_image(golden("cmyk.jpg"));
    CHECK(ink.shape() == Shape{8, 8, 3});
    check_values(image_part(ink, 0, 0, 1, 1), {1, 1, 3}, {192, 96, 0}, 255.0);
    const ScratchFolder folder;
    write_animation(folder / "a.gif",
                    {Tensor::full({16, 16, 3}, 1.0), Tensor::full({16, 16, 3}, 0.0)}, 10.0);
    CHECK(read_image(folder / "a.gif").shape() == Shape{16, 16, 3});
    CHECK(read_image(folder / "a.gif").to_vector().front() > 0.9);
    write_image(folder / "pixel.png", Tensor::full({1, 1, 3}, 0.2));
    check_values(read_image(folder / "pixel.png"), {1, 1, 3}, {51, 51, 51}, 255.0);
}

TEST_CASE("a header that claims more pixels than its file can hold is refused without reading") {
    const ScratchFolder folder;
    write_image(folder / "small.png", random_image(4, 4, 1));
    write_exr(folder / "small.exr", random_image(4, 4, 3));
    const auto number = [](std::uint32_t value, bool big_endian) {
        std::string bytes;
        for (unsigned i = 0; i < 4; ++i)
            bytes += static_cast<char>(value >> (8 * (big_endian ? 3 - i : i)));
        return bytes;
    };
    const auto lying_png = [&](std::uint32_t width, std::uint32_t height) {
        std::string bytes = read_file(folder / "small.png");
        bytes.replace(16, 8, number(width, true) + number(height, true));
        std::uint32_t sum = 0xFFFFFFFFU;  // of the header's type and data
        for (std::size_t i = 12; i < 29; ++i) {
            sum ^= static_cast<unsigned char>(bytes[i]);
            for (int k = 0; k < 8; ++k) sum = sum >> 1 ^ (sum % 2 == 1 ? 0xEDB88320U : 0U);
        }
        return bytes.replace(29, 4, number(~sum, true));
    };
    const auto lying_exr = [&](std::uint32_t last) {
        std::string bytes = read_file(folder / "small.exr");
        for (const char* name : {"dataWindow", "displayWindow"}) {
            const std::size_t box = bytes.find(name) + std::string(name).size() + 1 + 6 + 4;
            bytes.replace(box + 8, 8, number(last, false) + number(last, false));
        }
        return bytes;
    };
    write_file(folder / "huge.png", lying_png(30000, 30000));
    write_file(folder / "large.png", lying_png(16000, 16000));
    // OpenImageIO would read hundreds of rows of this width at a time.
    write_file(folder / "wide.png", lying_png(851'972, 1));
    write_file(folder / "huge.exr", lying_exr(29999));
    write_file(folder / "large.exr", lying_exr(15999));
    CHECK_THROWS_WITH(read_image(folder / "huge.png"), Contains("too large: 30000 x 30000 pixels"));
    const auto mask_of = [](const std::filesystem::path& path) { return read_mask(path); };
    for (const auto& read : {+mask_of, &read_class_map})
        CHECK_THROWS_WITH(read(folder / "wide.png"),
                          Contains("too large: 851972 x 1 pixels; a side may have at most 65535"));
    CHECK_THROWS_WITH(read_image(folder / "large.png"),
                      Contains("bytes claim 16000 x 16000 pixels"));
    // OpenEXR itself misses the lines that the header promises.
    for (const char* name : {"huge.exr", "large.exr"})
        CHECK_THROWS_AS(read_image(folder / name), FileError);
    CHECK_THROWS_WITH(read_class_map(folder / "huge.png"), Contains("too large"));
    CHECK_THROWS_WITH(read_class_map(folder / "large.png"), Contains("bytes claim"));
    CHECK_THROWS_WITH(read_mask(folder / "large.png"), Contains("bytes claim"));
    CHECK_THROWS_WITH(read_image(folder / "large.png", 1 << 20),
                      Contains("too large: 16000 x 16000 pixels; at most 1048576 are allowed"));
}

TEST_CASE("images that cannot be written are refused and leave nothing") {
    const ScratchFolder folder;
    const Tensor image = random_image(4, 4, 3);
    CHECK_THROWS_WITH(write_image(folder / "a.bmp", image), Contains("end in .png or .jpg"));
    CHECK_THROWS_AS(write_image(folder / "none/a.png", image), FileError);
    CHECK_THROWS_AS(write_image(folder / "a.png", random_image(4, 4, 2)), ShapeError);
    CHECK_THROWS_WITH(write_image(folder / "a.jpg", random_image(4, 4, 4)),
                      Contains("has no transparency"));
    CHECK_THROWS_AS(write_exr(folder / "a.exr", random_image(4, 4, 4)), ShapeError);
    CHECK_THROWS_AS(write_exr(folder / "a.png", image), FileError);
    CHECK_THROWS_AS(write_animation(folder / "a.gif", {}, 10.0), ValueError);
    CHECK_THROWS_AS(write_animation(folder / "a.gif", {image}, 0.0), ValueError);
    CHECK_THROWS_AS(write_animation(folder / "a.gif", {image, random_image(4, 5, 3)}, 10.0),
                    ShapeError);
    CHECK_THROWS_AS(write_animation(folder / "a.webm", {image}, 10.0), FileError);
    CHECK_THROWS_WITH(write_image(folder / "a.jpg", Tensor::zeros({1, 65501, 3})),
                      Contains("more than a JPEG file holds"));
    CHECK(folder.file_count() == 0);
}

TEST_CASE("an image that the disk does not take whole is an error, and nothing is left of it") {
    const ScratchFolder folder;
    const Tensor image = random_image(64, 64, 3);
    const auto limited = [](rlim_t bytes, const auto& write) {
        rlimit former{};
        ::getrlimit(RLIMIT_FSIZE, &former);
        const auto handler = std::signal(SIGXFSZ, SIG_IGN);
        const rlimit limit{bytes, former.rlim_max};
        ::setrlimit(RLIMIT_FSIZE, &limit);
        bool refused = false;
        try {
            write();
        } catch (const FileError&) {
            refused = true;
        }
        ::setrlimit(RLIMIT_FSIZE, &former);
        std::signal(SIGXFSZ, handler);
        return refused;
    };
    for (const rlim_t bytes : {0, 100, 2000}) {
        INFO(bytes);
        CHECK(limited(bytes, [&] { write_image(folder / "a.png", image); }));
        CHECK(limited(bytes, [&] { write_image(folder / "a.jpg", image); }));
        CHECK(limited(bytes, [&] { write_exr(folder / "a.exr", image); }));
        CHECK(limited(bytes, [&] { write_animation(folder / "a.gif", {image, image}, 10.0); }));
        CHECK(limited(bytes, [&] { write_animation(folder / "a.webp", {image, image}, 10.0); }));
        CHECK(limited(bytes, [&] { write_animation(folder / "a.mp4", {image, image}, 10.0); }));
        CHECK(folder.file_count() == 0);
    }
}

TEST_CASE("animations repeat without end and hold every frame") {
    const ScratchFolder folder;
    std::vector<Tensor> frames;
    for (int i = 0; i < 5; ++i) {
        frames.push_back(Tensor::full({31, 33, 3}, 0.2 * i));
    }
    write_animation(folder / "a.gif", frames, 12.5);
    const std::string gif = read_file(folder / "a.gif");
    CHECK(gif.find(std::string("NETSCAPE2.0\x03\x01\0\0", 15)) != std::string::npos);
    std::size_t frame_count = 0;
    const std::string frame_header("\x21\xf9\x04\x05\x08\0", 6);  // a delay of 8 hundredths
    for (std::size_t at = gif.find(frame_header); at != std::string::npos;
         at = gif.find(frame_header, at + 1)) {
        ++frame_count;
    }
    CHECK(frame_count == 5);
    CHECK(read_image(folder / "a.gif").shape() == Shape{31, 33, 3});

    // At 30 frames a second delays of 3 and 4 hundredths take turns, so 5 frames last 17.
    write_animation(folder / "b.gif", frames, 30.0);
    const std::string fast = read_file(folder / "b.gif");
    int hundredths = 0;
    const std::string control("\x21\xf9\x04\x05", 4);
    for (std::size_t at = fast.find(control); at != std::string::npos;
         at = fast.find(control, at + 1))
        hundredths += fast[at + 4];
    CHECK(hundredths == 17);

    write_animation(folder / "a.mp4", frames, 12.5);
    CHECK(read_file(folder / "a.mp4").substr(4, 4) == "ftyp");
    write_animation(folder / "a.webp", frames, 12.5);
    const std::string webp = read_file(folder / "a.webp");
    CHECK(webp.starts_with("RIFF"));
    CHECK(webp.find(std::string("ANIM\x06\0\0\0\xff\xff\xff\xff\0\0", 14)) !=
          std::string::npos);  // a white background, endlessly
    CHECK(folder.file_count() == 4);
}

TEST_CASE("an animation has the colours of its frames, and few small ones too") {
    // A face's colours in many shades, and two blue dots of four pixels.
    Tensor image({64, 64, 3});
    const auto values = image.mutable_values<float>();
    for (std::size_t i = 0; i < 64 * 64; ++i) {
        const float x = static_cast<float>(i % 64) / 63.0F, y = static_cast<float>(i / 64) / 63.0F;
        const bool iris =
            (i / 64 == 20 || i / 64 == 21) && i % 16 < 2 && i % 64 > 15 && i % 64 < 34;
        values[3 * i] = iris ? 0.2F : 0.4F + 0.5F * x;
        values[3 * i + 1] = iris ? 0.4F : 0.3F + 0.3F * x + 0.2F * y;
        values[3 * i + 2] = iris ? 0.9F : 0.2F + 0.3F * x * y;
    }
    const ScratchFolder folder;
    for (const char* name : {"a.gif", "a.webp"}) {
        INFO(name);
        write_animation(folder / name, {image, mirror_image(image)}, 10.0);
        const Tensor seen = read_image(folder / name);
        double squares = 0.0;
        for (std::size_t i = 0; i < values.size(); ++i)
            squares += std::pow(seen.values<float>()[i] - values[i], 2.0);
        CHECK(squares / static_cast<double>(values.size()) < 1e-4);  // 40 dB
        if (std::string(name) == "a.gif")
            CHECK(largest_difference(image_part(seen, 20, 16, 2, 2),
                                     image_part(image, 20, 16, 2, 2)) < 0.03);
    }
    // No more colours than the palette holds: not a bit is lost.
    Tensor few({16, 16, 3});
    for (std::size_t i = 0; i < few.mutable_values<float>().size(); ++i)
        few.mutable_values<float>()[i] = static_cast<float>(i * 7 % 240) / 255.0F;
    write_animation(folder / "few.gif", {few}, 10.0);
    CHECK(largest_difference(read_image(folder / "few.gif"), few) < 1e-6);
}

TEST_CASE("resampling keeps a constant and averages a fine pattern") {
    CHECK(largest_difference(resize_image(Tensor::full({9, 7, 3}, 0.3), 4, 20),
                             Tensor::full({4, 20, 3}, 0.3)) < 1e-6);
    std::vector<float> stripes(32 * 32);
    for (std::size_t i = 0; i < stripes.size(); ++i) {
        stripes[i] = static_cast<float>(i % 2);
    }
    const Tensor small =
        resize_image(Tensor::from({32, 32, 1}, std::span<const float>(stripes)), 8, 8);
    for (std::int64_t row = 0; row < 8; ++row) {
        for (std::int64_t column = 2; column < 6; ++column) {
            CHECK(small.values<float>()[static_cast<std::size_t>(row * 8 + column)] ==
                  Approx(0.5).margin(0.02));
        }
    }
    CHECK_THROWS_AS(resize_image(Tensor::zeros({4, 4, 3}), 0, 4), ShapeError);
}

TEST_CASE("tiles stand in rows and the missing ones are black") {
    const std::vector<Tensor> images = {Tensor::full({1, 2, 1}, 0.1), Tensor::full({1, 2, 1}, 0.2),
                                        Tensor::full({1, 2, 1}, 0.3)};
    check_values(tile_images(images, 2), {2, 4, 1}, {0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.0, 0.0});
    check_values(tile_images(images, 5), {1, 6, 1}, {0.1, 0.1, 0.2, 0.2, 0.3, 0.3});
    CHECK_THROWS_AS(tile_images({Tensor::zeros({1, 2, 1}), Tensor::zeros({2, 1, 1})}, 2),
                    ShapeError);
}

TEST_CASE("mirroring swaps left and right and keeps the channels in order") {
    const std::vector<float> values = {1, 2, 3, 4, 5, 6};
    check_values(mirror_image(Tensor::from({1, 2, 3}, std::span<const float>(values))), {1, 2, 3},
                 {4, 5, 6, 1, 2, 3});
}

TEST_CASE("colours of a PNG with alpha are those that were written") {
    const ScratchFolder folder;
    const Tensor image = random_image(7, 5, 4);
    write_image(folder / "a.png", image);
    png_image file{};
    file.version = PNG_IMAGE_VERSION;
    REQUIRE(png_image_begin_read_from_file(&file, (folder / "a.png").c_str()) != 0);
    REQUIRE(file.format == PNG_FORMAT_RGBA);
    std::vector<png_byte> bytes(PNG_IMAGE_SIZE(file));
    REQUIRE(png_image_finish_read(&file, nullptr, bytes.data(), 0, nullptr) != 0);
    for (std::size_t i = 0; i < bytes.size(); ++i)
        CHECK(std::abs(bytes[i] / 255.0 - image.values<float>()[i]) < 0.51 / 255.0);
}

TEST_CASE("a PNG in memory has the bytes of the file") {
    const ScratchFolder folder;
    for (const std::int64_t channels : {1, 3, 4}) {
        const Tensor image = random_image(7, 5, channels);
        write_image(folder / "a.png", image);
        CHECK(png_bytes(image) == read_file(folder / "a.png"));
    }
}

namespace {

/// A raw photo of 64 x 64 pixels (TIFF/EP): a grey thumbnail of 8 x 8 in front, and the light that
/// a sensor with sRGB's primaries sees, in red, green, green and blue pixels.
class RawPhoto {
public:
    explicit RawPhoto(std::uint32_t compression) {
        const std::uint32_t thumbnail = put(std::string(192, '\x80'));
        std::string light;
        for (int pixel = 0; pixel < 64 * 64; ++pixel) {
            const int place = pixel / 64 % 2 + pixel % 2;  // 0: red, 1: green, 2: blue
            light +=
                short_text(static_cast<std::uint32_t>(std::array{0.5, 0.3, 0.15}[place] * 65535));
        }
        const std::uint32_t pixels = put(light);
        const std::uint32_t raw = directory({{254, 4, {0}},
                                             {256, 4, {64}},
                                             {257, 4, {64}},
                                             {258, 3, {16}},
                                             {259, 3, {compression}},
                                             {262, 3, {32803}},
                                             {273, 4, {pixels}},
                                             {277, 3, {1}},
                                             {278, 4, {64}},
                                             {279, 4, {64 * 64 * 2}},
                                             {33421, 3, {2, 2}},
                                             {33422, 1, {0, 1, 1, 2}},
                                             {50717, 4, {65535}}});
        // IEC 61966-2-1: sRGB's light from XYZ.
        std::vector<std::uint32_t> matrix;
        for (const int value : {32406, -15372, -4986, -9689, 18758, 415, 557, -2040, 10570}) {
            matrix.push_back(static_cast<std::uint32_t>(value));
            matrix.push_back(10000);
        }
        const std::uint32_t first = directory({{254, 4, {1}},
                                               {256, 4, {8}},
                                               {257, 4, {8}},
                                               {258, 3, {8, 8, 8}},
                                               {259, 3, {1}},
                                               {262, 3, {2}},
                                               {271, 2, {'M', 'e', 0}},
                                               {272, 2, {'M', 'y', 0}},
                                               {273, 4, {thumbnail}},
                                               {277, 3, {3}},
                                               {278, 4, {8}},
                                               {279, 4, {192}},
                                               {330, 4, {raw}},
                                               {50706, 1, {1, 4, 0, 0}},
                                               {50708, 2, {'M', 'e', ' ', 'M', 'y', 0}},
                                               {50721, 10, matrix},
                                               {50728, 5, {1, 1, 1, 1, 1, 1}},
                                               {50778, 3, {21}}});
        bytes_.replace(4, 4, long_text(first));
    }
    [[nodiscard]] const std::string& bytes() const { return bytes_; }

private:
    struct Entry {
        std::uint32_t tag, type;
        std::vector<std::uint32_t> values;
    };

    static std::string short_text(std::uint32_t value) {
        return {static_cast<char>(value & 255), static_cast<char>(value >> 8 & 255)};
    }
    static std::string long_text(std::uint32_t value) {
        return short_text(value & 65535) + short_text(value >> 16);
    }
    std::uint32_t put(const std::string& data) {
        const auto place = static_cast<std::uint32_t>(bytes_.size());
        bytes_ += data + std::string((4 - data.size() % 4) % 4, '\0');
        return place;
    }
    std::uint32_t directory(const std::vector<Entry>& entries) {
        std::string text = short_text(static_cast<std::uint32_t>(entries.size()));
        for (const auto& [tag, type, values] : entries) {
            std::string data;
            for (const std::uint32_t value : values)
                data += type <= 2   ? std::string(1, static_cast<char>(value))
                        : type == 3 ? short_text(value)
                                    : long_text(value);
            const std::size_t fraction = type == 5 || type == 10 ? 2 : 1;
            text += short_text(tag) + short_text(type) +
                    long_text(static_cast<std::uint32_t>(values.size() / fraction));
            text +=
                data.size() > 4 ? long_text(put(data)) : data + std::string(4 - data.size(), '\0');
        }
        return put(text + long_text(0));
    }

    std::string bytes_ = std::string("II*\0\0\0\0\0", 8);
};

}  // namespace

TEST_CASE("a raw photo is developed, or refused if only its preview can be read") {
    const ScratchFolder folder;
    write_file(folder / "raw.dng", RawPhoto(1).bytes());
    const Tensor image = read_image(folder / "raw.dng");
    REQUIRE(image.shape() == Shape{64, 64, 3});
    const auto srgb = [](double light) { return 1.055 * std::pow(light, 1.0 / 2.4) - 0.055; };
    for (std::size_t c = 0; c < 3; ++c)
        CHECK(image.values<float>()[3 * (32 * 64 + 32) + c] ==
              Approx(srgb(std::array{0.5, 0.3, 0.15}[c])).margin(0.01));
    constexpr std::uint32_t jpeg_xl = 52546;  // of DNG 1.7, which LibRaw 0.20 does not know
    write_file(folder / "new.dng", RawPhoto(jpeg_xl).bytes());
    CHECK_THROWS_WITH(read_image(folder / "new.dng"),
                      Contains("new.dng: only its preview of 8 x 8 pixels can be read"));
    write_file(folder / "cut.dng", RawPhoto(1).bytes().substr(0, 4000));
    CHECK_THROWS_WITH(read_image(folder / "cut.dng"), Contains("cut.dng: "));
}
