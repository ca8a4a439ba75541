#include <OpenImageIO/imageio.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <sstream>

#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "render/camera_matrices.h"
#include "shared_data.h"
#include "support/error_message.h"
#include "train/data/dataset.h"
#include "train/data/folder_scan.h"
#include "train/data/image_files.h"

namespace image_files_tests {

using namespace stymo;
namespace fs = std::filesystem;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Names = std::vector<std::string>;

void put_image(const fs::path& path) {
    fs::create_directories(path.parent_path());
    write_image(path, Tensor::full({8, 8, 3}, 0.5));
}

void put(const fs::path& path, const std::string& bytes) {
    fs::create_directories(path.parent_path());
    write_file(path, bytes);
}

Names ids_in(const fs::path& folder) {
    Names ids;
    for (const FaceFiles& face : scan_folder(folder).faces) ids.push_back(face.id);
    return ids;
}

Names left_out_of(const ScratchFolder& folder) {
    Names lines;
    for (const BrokenFile& item : scan_folder(folder.path()).left_out)
        lines.push_back(fs::path(item.file).lexically_relative(folder.path()).string() + ": " +
                        item.reason);
    return lines;
}

std::string label(const std::array<double, 16>& world_from_camera) {
    std::ostringstream text;
    for (const double number : world_from_camera) text << number << ", ";
    return "[" + text.str() + "4.2647, 0, 0.5, 0, 4.2647, 0.5, 0, 0, 1]";
}

}  // namespace image_files_tests

using namespace image_files_tests;

TEST_CASE("photos are found by their content, and what is none is named with its reason") {
    const ScratchFolder folder;
    put_image(folder / "a.png");
    fs::copy_file(folder / "a.png", folder / "b.picture");
    fs::copy_file(folder / "a.png", folder / "no_ending");
    write_image(folder / "c.jpg", Tensor::full({8, 8, 3}, 0.5));
    fs::rename(folder / "c.jpg", folder / "c.JFIF");
    const auto output = OIIO::ImageOutput::create((folder / "d.jp2").string());
    REQUIRE(output);
    const std::vector<std::uint8_t> grey(std::size_t{32} * 32 * 3, 128);
    REQUIRE(output->open((folder / "d.jp2").string(), OIIO::ImageSpec(32, 32, 3)));
    REQUIRE(output->write_image(OIIO::TypeUInt8, grey.data()));
    REQUIRE(output->close());
    put(folder / "clip.mov", std::string("\0\0\0\x14"
                                         "ftypqt  \0\0\0\0qt  ",
                                         20));
    put(folder / "faces.zip", "PK\x03\x04 and more");
    put(folder / "new.jxl", "\xff\x0a and more");
    put(folder / "notes.txt", "hello, world");
    put(folder / "nothing.heic", "");
    for (const char* name : {".hidden.png", "._a.png", "Thumbs.db", "@eaDir/a.png/THUMB.jpg"})
        put(folder / name, "no image");
    CHECK(ids_in(folder.path()) == Names{"a", "b", "c", "d", "no_ending"});
    CHECK(left_out_of(folder) ==
          Names{"clip.mov: a video", "faces.zip: an archive; unpack it and give the folder",
                "new.jxl: JPEG XL is not read; save it as JPEG or PNG", "notes.txt: not an image",
                "nothing.heic: not an image (zero bytes)"});
    const Dataset faces(folder.path(), 8, {}, Split::all);
    CHECK(faces.size() == 5);
    CHECK_THAT(faces.summary().text(), Contains("left out 1 file (a video): "));
}

TEST_CASE("the containers of phones are told by their brands") {
    const ScratchFolder folder;
    const auto reason = [&](const std::string& bytes) {
        write_file(folder / "file", bytes);
        return reason_against(folder / "file");
    };
    const auto brands = [](const std::string& names) {
        return std::string("\0\0\0\x1c", 4) + "ftyp" + names;
    };
    CHECK(reason(brands("heic") + "\0\0\0\0mif1heic").empty());
    CHECK(reason(brands("avif")).empty());
    CHECK(reason(brands("mif1")).empty());
    CHECK(reason(brands("isomiso2avc1mp41")) == "a video");
    CHECK(reason("RIFF....AVI LIST") == "a video");
    CHECK(reason("RIFF....WEBPVP8 ").empty());
    CHECK(reason(std::string("II*\0\x08\0\0\0", 8)).empty());
    CHECK(reason("P6\n8 8 255\n").empty());
    CHECK(reason("Picture") == "not an image");
    for (std::size_t length = 1; length < 12; ++length)
        CHECK_FALSE(reason(brands("heic").substr(0, length)).empty());
}

TEST_CASE("what is left out is counted by reason, and the first files are named") {
    std::vector<BrokenFile> files;
    for (int i = 0; i < 5; ++i) files.push_back({std::to_string(i) + ".txt", "not an image"});
    files.push_back({"a.zip", "an archive"});
    CHECK(left_out_text(files) ==
          "left out 1 file (an archive): a.zip\n"
          "left out 5 files (not an image): 0.txt, 1.txt, 2.txt and 2 more");
    CHECK(left_out_text({}).empty());
}

TEST_CASE("a folder without images says what it holds, and an archive is named as such") {
    const ScratchFolder folder;
    put(folder / "set/faces.zip", "PK\x03\x04 and more");
    const auto message = [&](const char* name) {
        const std::string text =
            test::error_message<FileError>([&] { static_cast<void>(scan_folder(folder / name)); });
        CHECK(test::is_one_line(text));
        return text;
    };
    CHECK_THAT(message("set"),
               Contains("no images") && Contains("unpack it") && Contains("set/faces.zip"));
    CHECK_THAT(message("set/faces.zip"), Contains("unpack it"));
    CHECK_THAT(message("none"), Contains("no such folder"));
}

TEST_CASE("a name that JSON cannot hold is left out, and said") {
    const ScratchFolder folder;
    put_image(folder / "a.png");
    put_image(folder / "b\xff.png");
    put_image(folder / "J\xfcrgen/c.png");
    CHECK(ids_in(folder.path()) == Names{"a"});
    const Names left_out = left_out_of(folder);
    REQUIRE(left_out.size() == 2);
    for (const std::string& line : left_out)
        CHECK_THAT(line, EndsWith(": its name is not UTF-8; rename it"));
}

TEST_CASE("links to folders are followed once, also in a loop") {
    const ScratchFolder folder, elsewhere;
    put_image(folder / "own/a.png");
    put_image(elsewhere / "b.png");
    fs::create_directory_symlink(elsewhere.path(), folder / "linked");
    fs::create_directory_symlink(folder.path(), folder / "own/loop");
    fs::create_directory_symlink(elsewhere.path(), folder / "twice");
    fs::create_symlink(folder / "gone", folder / "broken");
    CHECK(ids_in(folder.path()) == Names{"a", "b"});
    const Names left_out = left_out_of(folder);
    REQUIRE(left_out.size() == 3);
    CHECK(left_out[0] == "broken: a link to nothing");
    CHECK_THAT(left_out[1], Contains("own/loop: a link to a folder that is listed as "));
    CHECK_THAT(left_out[2], Contains("twice: a link to a folder that is listed as "));
}

TEST_CASE("a folder is listed where it is, not where a link shows it") {
    const ScratchFolder folder;
    put_image(folder / "a/1.png");
    put_image(folder / "b/1.png");
    fs::create_directory_symlink("../b", folder / "a/link");
    fs::create_symlink("self", folder / "self");
    CHECK(ids_in(folder.path()) == Names{"a/1", "b/1"});
    CHECK(left_out_of(folder).size() == 2);
}

TEST_CASE("photos of the same name in folders of persons have their paths as ids") {
    const ScratchFolder folder;
    for (const char* name : {"anna/1.png", "anna/2.png", "ben/1.png"}) {
        put_image(folder / "images" / name);
        put_image(folder / "masks" / name);
    }
    put(folder / "faces.jsonl", R"({"id":"ben/1","pose":{"yaw_deg":9,"pitch_deg":0,"roll_deg":0,)"
                                R"("t":[0,0,5]}})");
    CHECK(ids_in(folder.path()) == Names{"anna/1", "anna/2", "ben/1"});
    const FolderScan scan = scan_folder(folder.path());
    for (const FaceFiles& face : scan.faces)
        CHECK(face.mask == folder / "masks" / (face.id + ".png"));
    REQUIRE(scan.records.find("ben/1") != nullptr);
    // The ids stay when no two names are equal any more.
    fs::remove(folder / "images/anna/1.png");
    CHECK(ids_in(folder.path()) == Names{"anna/2", "ben/1"});
    fs::remove(folder / "faces.jsonl");
    fs::remove_all(folder / "masks");
    CHECK(ids_in(folder.path()) == Names{"1", "2"});
}

TEST_CASE("of a photo in two formats one is taken, and the other is named") {
    const ScratchFolder folder;
    put_image(folder / "IMG_1.JPG.png");
    fs::rename(folder / "IMG_1.JPG.png", folder / "IMG_1.PNG");
    put(folder / "IMG_1.DNG", std::string("II*\0 raw", 8));
    CHECK(ids_in(folder.path()) == Names{"IMG_1"});
    CHECK(scan_folder(folder.path()).faces.front().image == folder / "IMG_1.PNG");
    CHECK(left_out_of(folder) == Names{"IMG_1.DNG: another file of the same name is taken"});
}

TEST_CASE("the labels of EG3D's dataset.json are the poses of its images") {
    const ScratchFolder folder;
    for (const char* name : {"00000/img00000000.png", "00000/img00000001.png", "00000/other.png"})
        put_image(folder / name);
    // By EG3D's LookAtPoseSampler: the columns are right, down and forward, of a camera that looks
    // at the origin from 2.7 units away. Ours is 5.3 units away at a focal length of 2.03.
    const double a = std::numbers::pi / 6.0, c = std::cos(a), s = std::sin(a);
    put(folder / "dataset.json",
        "{\"labels\": [[\"00000/img00000000.png\", " +
            label({1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2.7, 0, 0, 0, 1}) +
            "], [\"00000/img00000001.png\", " +
            label({c, 0, -s, 2.7 * s, 0, -1, 0, 0, -s, 0, -c, 2.7 * c, 0, 0, 0, 1}) + "]]}");
    const FolderScan scan = scan_folder(folder.path());
    CHECK(scan.left_out.empty());
    const auto pose = [&](const char* id) { return scan.records.find(id)->pose.value(); };
    CHECK(pose("img00000000").yaw == Approx(0.0).margin(1e-9));
    CHECK(pose("img00000000").translation[2] == Approx(5.3));
    CHECK(pose("img00000001").yaw == Approx(a));
    CHECK(pose("img00000001").pitch == Approx(0.0).margin(1e-9));
    CHECK(pose("img00000001").translation[0] == Approx(5.3 * s));
    CHECK(pose("img00000001").translation[2] == Approx(5.3 * c));
    CHECK(scan.records.find("other") == nullptr);
    CHECK(scan.records.read("img00000000").code.empty());
    CHECK(Dataset(folder.path(), 8, {}, Split::all).summary().without_pose == 1);

    put(folder / "dataset.json", R"({"labels": null})");
    CHECK(scan_folder(folder.path()).left_out.empty());
    put(folder / "dataset.json", R"({"labels": [["00000/other.png", 3]]})");
    CHECK(left_out_of(folder) == Names{"dataset.json: its labels are no cameras of EG3D"});
    put(folder / "dataset.json", "{");
    CHECK_THROWS_AS(scan_folder(folder.path()), FileError);
}

TEST_CASE("the photos of a phone are faces of a data set") {
    const auto shared = shared_data("cases/photos");
    if (!shared) return;
    const ScratchFolder folder;
    for (const char* name : {"iphone.heic", "photo.avif", "poster.jpg"})
        fs::copy_file(*shared / name, folder / name);
    const Dataset faces(folder.path(), 64, {}, Split::all);
    CHECK(faces.ids() == Names{"iphone", "photo", "poster"});
    CHECK(faces.summary().broken.empty());
}

TEST_CASE("a photo of which nothing is known is left out") {
    const ScratchFolder folder;
    put_image(folder / "images/1.png");
    put_image(folder / "images/2.png");
    fs::create_directories(folder / "unknown");
    write_image(folder / "unknown/2.png",
                Tensor::full(read_mask(folder / "images/2.png").shape(), 1.0));
    const Dataset faces(folder.path(), 8, DataConfig{.test = 0, .validation = 0}, Split::all);
    REQUIRE(faces.size() == 1);
    CHECK_THAT(faces.summary().broken.front().reason, Contains("leaves nothing of the photo"));
}
