#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <numbers>
#include <numeric>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "render/parsing_classes.h"
#include "shared_data.h"
#include "support/error_message.h"
#include "train/data/dataset.h"
#include "train/data/folder_scan.h"

using namespace stymo;
namespace fs = std::filesystem;

namespace {

/// Makes the folders of the paths that a test asks for.
struct TemporaryFolder : ScratchFolder {
    [[nodiscard]] fs::path operator/(const fs::path& name) const {
        fs::create_directories((path() / name).parent_path());
        return path() / name;
    }
};

using Rgb = std::array<float, 3>;
constexpr Rgb grey{0.6F, 0.6F, 0.6F};

Tensor plain(std::int64_t height, std::int64_t width, const Rgb& color) {
    Tensor image({height, width, 3});
    const std::span<float> values = image.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = color[i % 3];
    return image;
}

/// Left half `left`, right half `right`.
Tensor halves(std::int64_t side, const Rgb& left, const Rgb& right) {
    Tensor image({side, side, 3});
    const std::span<float> values = image.mutable_values<float>();
    for (std::int64_t pixel = 0; pixel < side * side; ++pixel)
        for (std::size_t c = 0; c < 3; ++c)
            values[static_cast<std::size_t>(pixel) * 3 + c] =
                (pixel % side < side / 2 ? left : right)[c];
    return image;
}

Tensor mask_of(std::int64_t side, float left, float right) {
    Tensor mask({side, side, 1});
    const std::span<float> values = mask.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = static_cast<std::int64_t>(i) % side < side / 2 ? left : right;
    return mask;
}

/// Writes raw channels of any kind that write_image does not make.
template <class T>
void write_raw(const fs::path& path, int height, int width, int channels,
               const std::vector<T>& values, int orientation = 1) {
    const auto output = OIIO::ImageOutput::create(path.string());
    REQUIRE(output);
    OIIO::ImageSpec spec(width, height, channels, OIIO::BaseTypeFromC<T>::value);
    spec.attribute("Orientation", orientation);
    if (channels == 4) spec.alpha_channel = 3;
    REQUIRE(output->open(path.string(), spec));
    REQUIRE(output->write_image(OIIO::BaseTypeFromC<T>::value, values.data()));
    REQUIRE(output->close());
}

float pixel(const Tensor& image, std::int64_t row, std::int64_t column, std::int64_t channel) {
    return image.values<float>()[static_cast<std::size_t>(
        (row * image.shape(1) + column) * image.shape(2) + channel)];
}

DataConfig nothing_held_out() {
    DataConfig config;
    config.test = 0;
    config.validation = 0;
    return config;
}

Dataset open(const TemporaryFolder& folder, std::int64_t side = 64) {
    return Dataset(folder.path(), side, nothing_held_out(), Split::all);
}

/// The message of an error that must be one line.
template <class ErrorType, class Body>
std::string line_of(Body body) {
    const std::string message = test::error_message<ErrorType>(body);
    CHECK(test::is_one_line(message));
    return message;
}

bool same(const Tensor& a, const Tensor& b) {
    return a.shape() == b.shape() && std::ranges::equal(a.values<float>(), b.values<float>());
}

std::string code_json(int first) {
    std::string text = "{";
    for (std::size_t group = 0; group < code_sizes.size(); ++group) {
        text += (group == 0 ? "\"" : ",\"") + std::string(code_names[group]) + "\":[";
        for (std::int64_t i = 0; i < code_sizes[group]; ++i)
            text += (i == 0 ? "" : ",") + std::to_string(first++);
        text += "]";
    }
    return text + "}";
}

}  // namespace

TEST_CASE("images are found flat, below images and below images1024x1024, in order of id",
          "[dataset]") {
    for (const char* sub_folder : {"", "images/", "images1024x1024/00000/", "some/where/"}) {
        INFO("folder '" << sub_folder << "'");
        const TemporaryFolder folder;
        for (const char* id : {"10", "9", "a", "007"})
            write_image(folder / (sub_folder + std::string(id) + ".png"), plain(8, 8, grey));
        write_image(folder / "masks/9.png", mask_of(8, 1.0F, 0.0F));
        const FolderScan scan = scan_folder(folder.path());
        std::vector<std::string> ids;
        for (const FaceFiles& files : scan.faces) ids.push_back(files.id);
        CHECK(ids == std::vector<std::string>{"007", "9", "10", "a"});
        CHECK(scan.faces[0].mask.empty());
        CHECK(scan.faces[1].mask == folder.path() / "masks/9.png");
    }
}

TEST_CASE("of FFHQ's image folders only the aligned one is read", "[dataset]") {
    const TemporaryFolder folder;
    write_image(folder / "images1024x1024/00000/00001.png", plain(8, 8, grey));
    write_image(folder / "thumbnails128x128/00000/00001.png", plain(8, 8, grey));
    CHECK(scan_folder(folder.path()).faces.size() == 1);
}

TEST_CASE("grey, RGBA, 16-bit, rotated and odd-sized images are read", "[dataset]") {
    const TemporaryFolder folder;
    write_raw<std::uint8_t>(folder / "1_grey.png", 9, 9, 1, std::vector<std::uint8_t>(81, 153));
    std::vector<std::uint8_t> rgba;
    for (int i = 0; i < 100; ++i) rgba.insert(rgba.end(), {255, 51, 0, 255});
    write_raw<std::uint8_t>(folder / "2_rgba.png", 10, 10, 4, rgba);
    write_raw<std::uint16_t>(folder / "3_deep.png", 8, 8, 3,
                             std::vector<std::uint16_t>(192, 39321));
    // The camera held on its side: stored rows run from bottom to top of the scene, so what is
    // stored at the top lies at the right.
    std::vector<std::uint8_t> sideways;
    for (int row = 0; row < 64; ++row)
        for (int value = 0; value < 64 * 3; ++value) sideways.push_back(row < 32 ? 255 : 0);
    write_raw<std::uint8_t>(folder / "4_rotated.jpg", 64, 64, 3, sideways, 6);
    Tensor wide = plain(31, 47, {0.0F, 0.0F, 0.0F});
    {
        const std::span<float> values = wide.mutable_values<float>();
        for (std::int64_t row = 0; row < 31; ++row)
            std::fill_n(values.begin() + (row * 47 + 8) * 3, 31 * 3, 0.4F);
    }
    write_image(folder / "5_odd.png", wide);

    const Dataset faces = open(folder);
    REQUIRE(faces.size() == 5);
    CHECK(faces.summary().broken.empty());
    for (std::int64_t i = 0; i < faces.size(); ++i) {
        CHECK(faces.load(i).image.shape() == Shape{64, 64, 3});
        CHECK(faces.load(i).mask.shape() == Shape{64, 64, 1});
    }
    const auto color_of = [&](std::int64_t face, std::int64_t row, std::int64_t column) {
        const Tensor image = faces.load(face).image;
        return std::vector<int>{
            static_cast<int>(std::lround(pixel(image, row, column, 0) * 255.0F)),
            static_cast<int>(std::lround(pixel(image, row, column, 1) * 255.0F)),
            static_cast<int>(std::lround(pixel(image, row, column, 2) * 255.0F))};
    };
    CHECK(color_of(0, 5, 60) == std::vector<int>{153, 153, 153});
    CHECK(color_of(1, 5, 60) == std::vector<int>{255, 51, 0});
    CHECK(color_of(2, 5, 60) == std::vector<int>{153, 153, 153});
    CHECK(color_of(3, 32, 60)[0] > 250);
    CHECK(color_of(3, 32, 3)[0] < 5);
    // The central square alone: the black margins are gone to the very edge.
    CHECK(color_of(4, 32, 0) == std::vector<int>{102, 102, 102});
    CHECK(color_of(4, 32, 63) == std::vector<int>{102, 102, 102});
}

TEST_CASE("masks come from masks, from the parsing's head classes and from CelebAMask-HQ's parts",
          "[dataset]") {
    const TemporaryFolder folder;
    for (const char* id : {"1", "2", "3", "4"})
        write_image(folder / ("CelebA-HQ-img/" + std::string(id) + ".jpg"), plain(64, 64, grey));
    write_image(folder / "masks/1.png", mask_of(64, 1.0F, 0.0F));
    // One column for each class 0..18, each three pixels wide.
    std::vector<std::uint8_t> classes;
    for (int i = 0; i < 64 * 64; ++i)
        classes.push_back(static_cast<std::uint8_t>(std::min(18, i % 64 / 3)));
    write_raw<std::uint8_t>(folder / "parsing/2.png", 64, 64, 1, classes);
    write_image(folder / "CelebAMask-HQ-mask-anno/0/00003_hair.png", mask_of(64, 1.0F, 0.0F));
    write_image(folder / "CelebAMask-HQ-mask-anno/0/00003_skin.png", mask_of(64, 0.0F, 1.0F));
    write_image(folder / "CelebAMask-HQ-mask-anno/0/00004_l_eye.png", mask_of(64, 1.0F, 0.0F));
    write_image(folder / "CelebAMask-HQ-mask-anno/0/00004_cloth.png", mask_of(64, 1.0F, 1.0F));

    const Dataset faces = open(folder);
    REQUIRE(faces.size() == 4);
    CHECK(faces.summary().without_mask == 0);
    CHECK(pixel(faces.load(0).mask, 10, 10, 0) == 1.0F);
    CHECK(pixel(faces.load(0).mask, 10, 50, 0) == 0.0F);
    for (int index = 0; index < 19; ++index) {
        INFO("class " << index);
        const bool head = index != 0 && index != 14 && index < 16;
        CHECK(is_head_class(index) == head);
        CHECK(pixel(faces.load(1).mask, 10, index * 3 + 1, 0) == (head ? 1.0F : 0.0F));
    }
    CHECK(pixel(faces.load(2).mask, 10, 10, 0) == 1.0F);
    CHECK(pixel(faces.load(2).mask, 10, 50, 0) == 1.0F);
    CHECK(pixel(faces.load(3).mask, 10, 10, 0) == 1.0F);
    CHECK(pixel(faces.load(3).mask, 10, 50, 0) == 0.0F);
}

TEST_CASE(
    "the face without hair and ears is told by the parsing, else by CelebAMask-HQ's parts, beside "
    "any head mask",
    "[dataset]") {
    const TemporaryFolder folder;
    for (const char* id : {"1", "2", "3", "4"})
        write_image(folder / ("CelebA-HQ-img/" + std::string(id) + ".jpg"), plain(64, 64, grey));
    write_image(folder / "masks/1.png", mask_of(64, 1.0F, 1.0F));
    std::vector<std::uint8_t> classes(64 * 64);
    for (std::size_t i = 0; i < classes.size(); ++i)
        classes[i] = static_cast<std::uint8_t>(std::min<std::size_t>(i % 64 / 3, 18));
    write_raw<std::uint8_t>(folder / "parsing/1.png", 64, 64, 1, classes);
    for (const char* part : {"hair", "l_ear", "ear_r"})
        write_image(folder / ("CelebAMask-HQ-mask-anno/0/00002_" + std::string(part) + ".png"),
                    mask_of(32, 1.0F, 0.0F));
    write_image(folder / "CelebAMask-HQ-mask-anno/0/00002_skin.png", mask_of(32, 0.0F, 1.0F / 255));
    write_image(folder / "CelebAMask-HQ-mask-anno/0/00003_hair.png", mask_of(32, 1.0F, 0.0F));

    const Dataset faces = open(folder);
    const Tensor parsed = read_face_region(faces.files(0));
    for (std::int64_t index = 0; index < parsing_class_count; ++index) {
        // The paper's facial region in CelebAMask-HQ's order: skin, nose, glasses, eyes, brows,
        // mouth and lips.
        const bool face = (index >= 1 && index <= 7) || (index >= 10 && index <= 12);
        CHECK(pixel(parsed, 10, index * 3 + 1, 0) == (face ? 1.0F : 0.0F));
    }
    CHECK(pixel(faces.load(0).mask, 10, 1, 0) == 1.0F);
    const Tensor merged = read_face_region(faces.files(1));
    CHECK(pixel(merged, 10, 5, 0) == 0.0F);
    CHECK(pixel(merged, 10, 25, 0) == 1.0F);
    for (const std::int64_t without : {2, 3}) {
        CHECK_FALSE(tells_face_region(faces.files(without)));
        CHECK_THROWS_AS(read_face_region(faces.files(without)), ValueError);
    }
    CHECK_THROWS_AS(faces.files(4), ValueError);
    std::ofstream(folder / "parsing/1.png") << "no image";
    CHECK_THROWS_WITH(read_face_region(faces.files(0)), Catch::Contains("parsing/1.png: "));
}

TEST_CASE("unknown pixels come from unknown, each pixel with a part of one counts", "[dataset]") {
    const TemporaryFolder folder;
    for (const char* name : {"images/1.png", "images/2.png", "images/3.png"})
        write_image(folder / name, plain(128, 128, grey));
    write_image(folder / "unknown/1.png", mask_of(128, 0.0F, 1.0F));
    write_image(folder / "unknown/2.png", mask_of(128, 0.0F, 0.05F));  // not white
    write_image(folder / "unknown/3.png", mask_of(100, 0.0F, 1.0F));
    for (const std::int64_t megabytes : {0, 100}) {
        DataConfig config = nothing_held_out();
        config.cache_megabytes = megabytes;
        const Dataset faces(folder.path(), 64, config, Split::all);
        REQUIRE(faces.size() == 3);
        const Face face = faces.load(0);
        REQUIRE(face.known.defined());
        // The filter reaches from pixel 57 to 64, and from 55 to 62.
        CHECK(pixel(face.known, 9, 30, 0) == 0.0F);
        CHECK(pixel(face.known, 9, 29, 0) == 1.0F);
        CHECK(pixel(face.known, 9, 32, 0) == 0.0F);
        CHECK_FALSE(faces.load(1).known.defined());
        CHECK(pixel(faces.load(2).known, 9, 28, 0) == 1.0F);
        CHECK(pixel(faces.load(2).known, 9, 32, 0) == 0.0F);
    }
    write_image(folder / "unknown/3.png", Tensor::zeros({100, 50, 1}));
    CHECK(open(folder).size() == 3);  // an empty mask of any size ignores nothing
    write_image(folder / "unknown/3.png", Tensor::full({100, 50, 1}, 1.0));
    CHECK(open(folder).summary().broken.front().file == (folder / "unknown/3.png").string());
}

TEST_CASE("what a face lacks is filled in, counted and said once", "[dataset]") {
    const TemporaryFolder folder;
    for (const char* id : {"1", "2", "3"})
        write_image(folder / ("images/" + std::string(id) + ".png"), plain(64, 64, grey));
    write_image(folder / "masks/1.png", mask_of(64, 1.0F, 0.0F));
    write_file(
        folder / "faces.jsonl",
        R"({"id":"1","pose":{"yaw_deg":30,"pitch_deg":-10,"roll_deg":5,"t":[1,2,3]},"code":)" +
            code_json(0) + "}\n\n" + R"({"id":"2","code":)" + code_json(0) + "}\r\n");
    write_file(folder / "camera.json", R"({"focal":3.5,"cx":0.4,"cy":0.6})");

    const CameraConfig model{.intrinsics = {}, .distance = 7.5};
    const Dataset faces(folder.path(), 64, nothing_held_out(), Split::all, model);
    const DatasetSummary summary = faces.summary();
    CHECK(summary.faces == 3);
    CHECK(summary.without_mask == 2);
    CHECK(summary.without_pose == 2);
    CHECK(summary.without_code == 1);
    CHECK_THAT(summary.text(), Catch::Contains("3 faces") && Catch::Contains("2 without a mask") &&
                                   Catch::Contains("2 without a pose") &&
                                   Catch::Contains("1 without a code"));

    const Face first = faces.load(0);
    CHECK(first.has_mask);
    CHECK(first.has_pose);
    CHECK(first.has_code);
    CHECK(first.pose.yaw == Approx(std::numbers::pi / 6.0));
    CHECK(first.pose.pitch == Approx(-std::numbers::pi / 18.0));
    CHECK(first.pose.translation == Eigen::Vector3d{1.0, 2.0, 3.0});
    CHECK(first.intrinsics.focal == 3.5);
    REQUIRE(first.code.size() == 306);
    CHECK(first.code[305] == 305.0F);

    const Face last = faces.load(2);
    CHECK_FALSE(last.has_mask);
    CHECK_FALSE(last.has_pose);
    CHECK_FALSE(last.has_code);
    // The face is as large as from 7.5 with the model's focal length.
    CHECK(last.pose.translation.isApprox(Eigen::Vector3d{0.0, 0.0, 0.9 + 6.6 * 3.5 / 2.03}));
    CHECK(same(last.mask, Tensor::full({64, 64, 1}, 1.0)));
}

TEST_CASE("a broken image or mask is skipped and named, cached or not", "[dataset]") {
    const TemporaryFolder folder;
    for (const char* id : {"1", "3", "4"})
        write_image(folder / (std::string(id) + ".png"), plain(64, 64, grey));
    std::ofstream(folder / "2.png") << "not an image";
    std::ofstream(folder / "masks/4.png").flush();
    for (const std::int64_t megabytes : {1000, 0}) {
        DataConfig config = nothing_held_out();
        config.cache_megabytes = megabytes;
        const Dataset faces(folder.path(), 64, config, Split::all);
        std::vector<std::string> loaded;
        for (std::int64_t i = 0; i < faces.size(); ++i) loaded.push_back(faces.load(i).id);
        const bool cached = megabytes > 0;
        CHECK(loaded == (cached ? std::vector<std::string>{"1", "3"}
                                : std::vector<std::string>{"1", "3", "3", "1"}));
        const DatasetSummary summary = faces.summary();
        CHECK(summary.faces == 2);
        REQUIRE(summary.broken.size() == 2);
        CHECK(summary.broken[0].file == (folder.path() / "2.png").string());
        CHECK(summary.broken[1].file == (folder.path() / "masks/4.png").string());
        CHECK_FALSE(summary.broken[0].reason.empty());
        CHECK(summary.broken[0].reason.find("2.png") == std::string::npos);
    }
}

TEST_CASE("a folder that cannot be used gives one clear line", "[dataset]") {
    const TemporaryFolder folder;
    CHECK_THAT(line_of<FileError>([&] { open(folder); }),
               Catch::Contains(folder.path().string()) && Catch::Contains("no images"));
    CHECK_THAT(line_of<FileError>([&] { Dataset("/nowhere", 64, {}, Split::all); }),
               Catch::Contains("/nowhere: no such folder"));
    std::ofstream(folder / "1.png") << "not an image";
    CHECK_THAT(line_of<FileError>([&] { open(folder); }),
               Catch::Contains("none of its 1 images can be read"));
    write_image(folder / "a/2.png", plain(8, 8, grey));
    write_image(folder / "a/2.jpg", plain(8, 8, grey));
    CHECK_THAT(line_of<FileError>([&] { open(folder); }),
               Catch::Contains("two images have the id \"2\""));
}

TEST_CASE("a malformed line of faces.jsonl is refused with its number", "[dataset]") {
    const TemporaryFolder folder;
    write_image(folder / "1.png", plain(8, 8, grey));
    const auto message_for = [&](const std::string& line) {
        write_file(folder / "faces.jsonl", R"({"id":"0"})"
                                           "\n" +
                                               line + "\n");
        return line_of<FileError>([&] { open(folder); });
    };
    for (const auto& [line, reason] : std::vector<std::pair<std::string, std::string>>{
             {R"({"id":"1")", "not JSON"},
             {R"([1])", "must be an object"},
             {R"({"pose":{}})", "no \"id\""},
             {R"({"id":1})", "no \"id\""},
             {R"({"id":"0"})", "comes twice"},
             {R"({"id":"1","poses":{}})", "unknown key \"poses\""},
             {R"({"id":"1","pose":{"yaw_deg":0,"pitch_deg":0,"roll_deg":0,"t":[0,0,5],"yaw":1}})",
              "unknown key \"yaw\""},
             {R"({"id":"1","pose":{"yaw_deg":"1","pitch_deg":0,"roll_deg":0,"t":[0,0,5]}})",
              "\"yaw_deg\" is not a number"},
             {R"({"id":"1","pose":{"yaw_deg":30}})", "\"pitch_deg\" is missing in \"pose\""},
             {R"({"id":"1","pose":{"yaw_deg":1e999}})", "not JSON"},
             {R"({"id":"1","code":{"id":[1,2]}})", "\"id\" must be an array of 100 numbers"},
             {R"({"id":"1","code":{}})", "\"code\" lacks \"id\""},
             {R"({"id":"1","landmarks":[[1,2]]})",
              "\"landmarks\" must be an array of 68 points"}}) {
        INFO(line);
        CHECK_THAT(message_for(line),
                   Catch::Contains("faces.jsonl, line 2: ") && Catch::Contains(reason));
    }
    fs::remove(folder / "faces.jsonl");
    write_file(folder / "camera.json", R"({"focal":0})");
    CHECK_THAT(line_of<FileError>([&] { open(folder); }),
               Catch::Contains("camera.json") && Catch::Contains("in [0.1, 100]"));
}

TEST_CASE("the split is by order of id, from the first or from the last", "[dataset]") {
    const TemporaryFolder folder;
    for (int i = 0; i < 12; ++i)
        write_image(folder / (std::to_string(i) + ".png"), plain(8, 8, grey));
    DataConfig config;
    config.test = 3;
    config.validation = 2;
    const auto first_and_last = [&](Split split) {
        const Dataset faces(folder.path(), 8, config, split);
        return faces.ids().front() + "-" + faces.ids().back();
    };
    CHECK(first_and_last(Split::test) == "0-2");
    CHECK(first_and_last(Split::validation) == "3-4");
    CHECK(first_and_last(Split::training) == "5-11");
    CHECK(first_and_last(Split::all) == "0-11");
    config.held_out = "last";
    CHECK(first_and_last(Split::training) == "0-6");
    CHECK(first_and_last(Split::validation) == "7-8");
    CHECK(first_and_last(Split::test) == "9-11");
    config.test = 1000;
    CHECK_THAT(line_of<ConfigError>([&] { Dataset(folder.path(), 8, config, Split::training); }),
               Catch::Contains("data.split") && Catch::Contains("12 faces"));
}

TEST_CASE("the split is by the photos that the folder was made of, whichever of them are missing",
          "[dataset]") {
    const TemporaryFolder folder;
    // Photos 0 to 11, of which preparation dropped 1 and 4; of photo 3 it took two faces.
    for (const char* id : {"0", "2", "3", "3_2", "5", "6", "7", "8", "9", "10", "11"})
        write_image(folder / ("images/" + std::string(id) + ".png"), plain(8, 8, grey));
    std::string photos;
    for (int i = 0; i < 12; ++i) photos += (i == 0 ? "\"" : ", \"") + std::to_string(i) + "\"";
    DataConfig config;
    config.test = 3;
    config.validation = 2;
    const auto ids = [&](Split split) { return Dataset(folder.path(), 8, config, split).ids(); };
    using Ids = std::vector<std::string>;
    CHECK(ids(Split::test) == Ids{"0", "2", "3"});
    write_file(folder / "report.json", "{\"ok\": 10, \"photos\": [" + photos + "]}");
    CHECK(ids(Split::test) == Ids{"0", "2"});
    CHECK(ids(Split::validation) == Ids{"3", "3_2"});
    CHECK(ids(Split::training) == Ids{"5", "6", "7", "8", "9", "10", "11"});
    config.held_out = "last";
    CHECK(ids(Split::test) == Ids{"9", "10", "11"});
    CHECK(ids(Split::validation) == Ids{"7", "8"});
    CHECK(ids(Split::all).size() == 11);
    // Reports of other tools say nothing of photos.
    write_file(folder / "report.json", R"({"photos": 3})");
    CHECK(ids(Split::test) == Ids{"10", "11", "3_2"});
}

TEST_CASE("faces do not depend on the cache or on the number of threads", "[dataset]") {
    const TemporaryFolder folder;
    Rng rng(1);
    for (int i = 0; i < 6; ++i)
        write_image(folder / (std::to_string(i) + ".png"), rng.uniform({70, 90, 3}, 0.0, 1.0));
    const std::vector<std::int64_t> indices{5, 0, 3, 3};
    const auto batch_with = [&](int threads, std::int64_t megabytes) {
        set_thread_count(threads);
        DataConfig config = nothing_held_out();
        config.cache_megabytes = megabytes;
        const Dataset faces(folder.path(), 64, config, Split::all);
        const FaceBatch batch = make_batch(faces.load(indices));
        set_thread_count(0);
        return batch;
    };
    const FaceBatch one = batch_with(1, 100);
    for (const auto& [threads, megabytes] :
         {std::pair{4, std::int64_t{100}}, std::pair{1, std::int64_t{0}},
          std::pair{4, std::int64_t{0}}}) {
        const FaceBatch other = batch_with(threads, megabytes);
        CHECK(same(one.input, other.input));
        CHECK(same(one.targets.back(), other.targets.back()));
        CHECK(same(one.ray_mask, other.ray_mask));
    }
}

TEST_CASE(
    "a batch holds the unmasked input, masked targets at every resolution, and black where the "
    "mask is 0",
    "[dataset]") {
    const TemporaryFolder folder;
    write_image(folder / "images/1.png", halves(128, {1.0F, 0.0F, 0.2F}, {0.4F, 1.0F, 0.8F}));
    write_image(folder / "masks/1.png", mask_of(128, 1.0F, 0.0F));
    write_image(folder / "images/2.png", plain(128, 128, grey));
    write_file(folder / "faces.jsonl", R"({"id":"2","code":)" + code_json(1) + "}\n");
    const Dataset faces = open(folder, 128);
    const FaceBatch batch = make_batch(faces.load(std::vector<std::int64_t>{0, 1}));

    CHECK(batch.input.shape() == Shape{2, 128, 128, 3});
    CHECK(batch.mask.shape() == Shape{2, 128, 128, 1});
    CHECK(batch.ray_mask.shape() == Shape{2, 32, 32, 1});
    REQUIRE(batch.targets.size() == 2);
    CHECK(batch.targets[0].shape() == Shape{2, 64, 64, 3});
    CHECK(batch.targets[1].shape() == Shape{2, 128, 128, 3});
    const auto first = [](const Tensor& images, std::int64_t row, std::int64_t column) {
        const std::int64_t at = (row * images.shape(2) + column) * 3;
        const std::span<const float> values =
            images.values<float>().subspan(static_cast<std::size_t>(at), 3);
        return std::vector<float>(values.begin(), values.end());
    };
    CHECK_THAT(first(batch.input, 60, 120),
               Catch::Approx(std::vector<float>{-0.2F, 1.0F, 0.6F}).margin(1e-5F));
    for (const Tensor& target : batch.targets) {
        const std::int64_t side = target.shape(1);
        CHECK_THAT(first(target, side / 2, 3),
                   Catch::Approx(std::vector<float>{1.0F, -1.0F, -0.6F}).margin(1e-5F));
        CHECK_THAT(first(target, side / 2, side - 3),
                   Catch::Approx(std::vector<float>{-1.0F, -1.0F, -1.0F}).margin(1e-5F));
        for (const float value : target.values<float>()) REQUIRE(std::abs(value) <= 1.0F);
    }
    for (const float value : batch.ray_mask.values<float>())
        REQUIRE((value >= 0.0F && value <= 1.0F));
    CHECK(batch.cameras.size() == 2);

    CHECK(batch.code_present.to_vector() == std::vector<double>{0.0, 1.0});
    for (std::size_t group = 0; group < code_sizes.size(); ++group)
        REQUIRE(batch.codes[group].shape() == Shape{2, code_sizes[group]});
    CHECK(batch.codes[0].to_vector()[99] == 0.0);
    CHECK(batch.codes[0].to_vector()[100] == 1.0);
    CHECK(batch.codes[3].to_vector().back() == 306.0);
}

TEST_CASE("a mirrored face shows its mask and pose mirrored and has no code", "[dataset]") {
    const TemporaryFolder folder;
    write_image(folder / "images/1.png", halves(64, {1.0F, 0.0F, 0.0F}, {0.0F, 0.0F, 1.0F}));
    write_image(folder / "masks/1.png", mask_of(64, 1.0F, 0.0F));
    write_file(
        folder / "faces.jsonl",
        R"({"id":"1","pose":{"yaw_deg":20,"pitch_deg":10,"roll_deg":5,"t":[1,2,3]},"code":)" +
            code_json(0) + "}\n");
    write_file(folder / "camera.json", R"({"focal":2,"cx":0.4,"cy":0.6})");
    const Face face = open(folder).load(0);
    const Face mirror = mirrored(face);
    CHECK(pixel(mirror.image, 5, 60, 0) == 1.0F);
    CHECK(pixel(mirror.mask, 5, 60, 0) == 1.0F);
    CHECK(pixel(mirror.mask, 5, 3, 0) == 0.0F);
    CHECK_FALSE(mirror.has_code);
    CHECK(make_batch(std::vector{mirror}).code_present.item() == 0.0);
    // A point and its mirror image about the plane x = 0 fall on mirrored positions of the two
    // images.
    const Eigen::Vector3d seen =
        project(camera_from_pose(face.pose, face.intrinsics), {0.3, 0.4, 0.5});
    const Eigen::Vector3d seen_in_mirror =
        project(camera_from_pose(mirror.pose, mirror.intrinsics), {-0.3, 0.4, 0.5});
    CHECK(seen_in_mirror[0] == Approx(1.0 - seen[0]));
    CHECK(seen_in_mirror[1] == Approx(seen[1]));
    const Face twice = mirrored(mirror);
    CHECK(same(twice.image, face.image));
    CHECK(twice.pose.yaw == Approx(face.pose.yaw));
}

TEST_CASE("faces that do not make a batch are refused", "[dataset]") {
    const TemporaryFolder folder;
    write_image(folder / "1.png", plain(8, 8, grey));
    CHECK_THROWS_AS(make_batch({}), ValueError);
    CHECK_THROWS_AS(make_batch(std::vector{open(folder, 96).load(0)}), ShapeError);
    CHECK_THROWS_AS(make_batch(std::vector{open(folder, 64).load(0), open(folder, 128).load(0)}),
                    ShapeError);
    CHECK_THROWS_AS(open(folder).load(1), ValueError);
}

TEST_CASE("the CelebAMask-HQ photos are read with their masks, the last hundred held out",
          "[dataset]") {
    const auto photos = shared_data("data/celebamask");
    if (!photos) return;
    DataConfig config;
    config.test = 100;
    config.validation = 0;
    config.held_out = "last";
    const Dataset training(*photos, 64, config, Split::training);
    const Dataset test(*photos, 64, config, Split::test);
    CHECK(training.size() == 700);
    CHECK(test.size() == 100);
    CHECK(test.ids().front() == "00700");
    const DatasetSummary summary = training.summary();
    CHECK(summary.broken.empty());
    CHECK(summary.without_mask == 0);
    CHECK(summary.without_pose == 700);
    CHECK(summary.without_code == 700);
    // Aligned heads fill about half of the frame.
    double covered = 0.0;
    for (std::int64_t i = 0; i < test.size(); ++i) {
        const Face face = test.load(i);
        const std::span<const float> mask = face.mask.values<float>();
        covered += std::accumulate(mask.begin(), mask.end(), 0.0) /
                   static_cast<double>(mask.size()) / 100.0;
    }
    CHECK(covered > 0.35);
    CHECK(covered < 0.75);
}
