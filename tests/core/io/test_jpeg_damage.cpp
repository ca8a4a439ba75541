#include <catch2/catch.hpp>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
// libjpeg's header does not include what it needs.
#include <jpeglib.h>

#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/jpeg.h"
#include "core/io/scratch_folder.h"
#include "core/rng.h"
#include "shared_data.h"

namespace jpeg_damage_tests {

using namespace stymo;

/// Noise in grey, encoded by libjpeg.
std::string encoded(bool progressive, int restart_rows = 0) {
    constexpr int side = 64;
    jpeg_compress_struct jpeg{};
    jpeg_error_mgr errors{};
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    unsigned char* bytes = nullptr;
    unsigned long size = 0;
    jpeg_mem_dest(&jpeg, &bytes, &size);
    jpeg.image_width = jpeg.image_height = side;
    jpeg.input_components = 1;
    jpeg.in_color_space = JCS_GRAYSCALE;
    jpeg_set_defaults(&jpeg);
    jpeg.restart_in_rows = restart_rows;
    if (progressive) jpeg_simple_progression(&jpeg);
    jpeg_start_compress(&jpeg, TRUE);
    Rng rng(1);
    std::vector<JSAMPLE> row(side);
    while (jpeg.next_scanline < jpeg.image_height) {
        for (JSAMPLE& value : row) value = static_cast<JSAMPLE>(rng.below(256));
        JSAMPROW pointer = row.data();
        jpeg_write_scanlines(&jpeg, &pointer, 1);
    }
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    std::string result(reinterpret_cast<const char*>(bytes), size);
    std::free(bytes);
    return result;
}

std::string with_wrong_scan(std::string bytes) {
    const std::size_t scan = bytes.find("\xff\xda");
    bytes[scan + 8] = 0;  // the last coefficient, for one component; 63 is right
    return bytes;
}

std::string with_inserted(std::string bytes, const std::string& marker, const std::string& stray) {
    return bytes.insert(bytes.find(marker), stray);
}

}  // namespace jpeg_damage_tests

using namespace jpeg_damage_tests;

TEST_CASE("a JPEG that libjpeg warns of is read if all of its pixels are there") {
    const ScratchFolder folder;
    const auto read = [&](const std::string& bytes) {
        write_file(folder / "photo.jpg", bytes);
        return read_image(folder / "photo.jpg");
    };
    const std::string whole = encoded(false);
    const std::string in_scans = encoded(true);
    const auto pixels = read(whole).to_vector();
    const std::string end = "\xff\xd9";
    for (const auto& [name, bytes] : std::vector<std::pair<std::string, std::string>>{
             {"wrong parameters of the scan", with_wrong_scan(whole)},
             {"another version of JFIF", std::string(whole).replace(11, 1, 1, 2)},
             {"stray bytes before the tables", with_inserted(whole, "\xff\xc4", "ab")},
             {"stray bytes before the end", with_inserted(whole, end, "ab")},
             {"no end mark", whole.substr(0, whole.size() - 2)},
             {"half an end mark", whole.substr(0, whole.size() - 1)},
             {"two of them", with_wrong_scan(whole.substr(0, whole.size() - 2))},
             {"bytes behind the end", whole + std::string(100, 'x')},
             {"in scans, no end mark", in_scans.substr(0, in_scans.size() - 2)}}) {
        INFO(name);
        CHECK_FALSE(jpeg_lost_pixels(bytes));
        CHECK(read(bytes).to_vector() == pixels);
        CHECK(image_from_jpeg(bytes, 1 << 20).to_vector() == pixels);
    }
}

TEST_CASE("a JPEG that has lost pixels is refused, whatever libjpeg says first") {
    const ScratchFolder folder;
    const std::string whole = encoded(false);
    const std::string restarts = encoded(false, 1);
    const std::string in_scans = encoded(true);
    const std::size_t last_scan = in_scans.rfind("\xff\xda");
    for (const auto& [name, bytes] : std::vector<std::pair<std::string, std::string>>{
             {"cut", whole.substr(0, whole.size() - 20)},
             {"cut, with wrong parameters", with_wrong_scan(whole.substr(0, whole.size() - 20))},
             {"cut, with an end mark", whole.substr(0, whole.size() - 20) + "\xff\xd9"},
             {"half", whole.substr(0, whole.size() / 2)},
             {"a part between restarts is missing",
              std::string(restarts).erase(restarts.find("\xff\xd1") + 4, 40)},
             {"a scan is missing", in_scans.substr(0, last_scan)}}) {
        INFO(name);
        CHECK(jpeg_lost_pixels(bytes));
        write_file(folder / "photo.jpg", bytes);
        CHECK_THROWS_AS(read_image(folder / "photo.jpg"), FileError);
        CHECK_THROWS_AS(image_from_jpeg(bytes, 1 << 20), FileError);
    }
    CHECK(jpeg_lost_pixels("\xff\xd8\xff"));
    CHECK(jpeg_inks(whole).empty());
}

TEST_CASE("odd JPEG files of phones have the pixels of a good one") {
    const auto folder = shared_data("cases/jpeg");
    if (!folder) return;
    const auto good = read_image(*folder / "good.jpg").to_vector();
    CHECK(read_image(*folder / "samsung_sos.jpg").to_vector() == good);
    CHECK(read_image(*folder / "extraneous_hdr.jpg").to_vector() == good);
    CHECK_THROWS_AS(read_image(*folder / "tail_lost.jpg"), FileError);
}
