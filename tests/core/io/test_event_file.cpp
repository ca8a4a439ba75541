#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <limits>

#include "core/error.h"
#include "core/io/checksum.h"
#include "core/io/event_file.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/scratch_folder.h"
#include "support/error_message.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

constexpr double golden_time = 1700000000.25;

EventFile::Clock stopped_clock() {
    return [] { return golden_time; };
}

std::uint64_t little_endian(std::string_view bytes) {
    std::uint64_t value = 0;
    for (std::size_t i = bytes.size(); i > 0; --i)
        value = (value << 8) | static_cast<unsigned char>(bytes[i - 1]);
    return value;
}

bool checksum_fits(std::string_view bytes, std::string_view stored) {
    const auto masked = static_cast<std::uint32_t>(little_endian(stored));
    return std::rotl(masked - 0xA282EAD8U, 15) == crc32c(bytes);
}

/// The messages of a file; checks the checksums of each record.
std::vector<std::string> read_records(const fs::path& path) {
    const std::string file = read_file(path);
    std::string_view rest = file;
    std::vector<std::string> messages;
    while (!rest.empty()) {
        REQUIRE(rest.size() >= 16);
        REQUIRE(checksum_fits(rest.substr(0, 8), rest.substr(8, 4)));
        const std::size_t length = little_endian(rest.substr(0, 8));
        REQUIRE(rest.size() >= length + 16);
        REQUIRE(checksum_fits(rest.substr(12, length), rest.substr(12 + length, 4)));
        messages.emplace_back(rest.substr(12, length));
        rest.remove_prefix(length + 16);
    }
    return messages;
}

std::vector<fs::path> files(const ScratchFolder& folder) {
    std::vector<fs::path> paths{fs::directory_iterator(folder.path()), fs::directory_iterator()};
    std::ranges::sort(paths, {}, [](const fs::path& path) { return path.filename(); });
    return paths;
}

/// The bytes of a PNG file within a message.
std::string png_within(const std::string& message) {
    return message.substr(message.find("\x89PNG"));
}

}  // namespace

TEST_CASE("CRC-32C gives the checksums of RFC 3720, appendix B.4", "[event_file]") {
    std::string ascending;
    std::string descending;
    for (int i = 0; i < 32; ++i) {
        ascending += static_cast<char>(i);
        descending += static_cast<char>(31 - i);
    }
    CHECK(crc32c(std::string(32, '\0')) == 0x8A9136AA);
    CHECK(crc32c(std::string(32, '\xFF')) == 0x62A8AB43);
    CHECK(crc32c(ascending) == 0x46DD794E);
    CHECK(crc32c(descending) == 0x113FDB5C);
    CHECK(crc32c("123456789") == 0xE3069283);
    CHECK(crc32c("56789", crc32c("1234")) == 0xE3069283);
    CHECK(crc32c("") == 0);
}

TEST_CASE("an event file has the bytes that TensorBoard's own writer gives it", "[event_file]") {
    const ScratchFolder folder;
    {
        EventFile events(folder.path(), stopped_clock());
        events.restart(101);
        events.scalar(0, "loss", 0.0);
        events.scalar(150, "loss", 0.125);
        std::string name = "stage 2/";
        for (int i = 0; i < 20; ++i) name += "long name ";
        events.scalar(3000000000, name, -1e-3);
        events.scalar(150, "not a number", std::numeric_limits<double>::quiet_NaN());
    }
    REQUIRE(files(folder).size() == 1);
    CHECK(files(folder)[0].filename() == "events.out.tfevents.1700000000.stymo");
    CHECK(read_file(files(folder)[0]) ==
          read_file(fs::path(STYMO_SOURCE_DIR) / "tests/golden/event_file.tfevents"));
}

TEST_CASE(
    "images are kept as PNG with their size, and every record can be read while the file grows",
    "[event_file]") {
    const ScratchFolder folder;
    const ScratchFolder scratch;
    Tensor image = Tensor::full({2, 3, 3}, 1.0);
    image.mutable_values<float>()[0] = 0.0F;
    EventFile events(folder.path());
    events.image(7, "samples", image);
    const std::vector<std::string> messages = read_records(files(folder)[0]);
    REQUIRE(messages.size() == 2);
    CHECK_THAT(messages[0], Catch::Contains("brain.Event:2"));
    // Height, width and colour space are the fields 1, 2 and 3, the image's bytes the field 4.
    CHECK_THAT(messages[1],
               Catch::Contains("samples") && Catch::Contains("\x08\x02\x10\x03\x18\x03\x22"));
    write_file(scratch / "image.png", png_within(messages[1]));
    CHECK(read_image(scratch / "image.png").to_vector() == image.to_vector());
    events.scalar(8, "loss", 1.0);
    CHECK(read_records(files(folder)[0]).size() == 3);
}

TEST_CASE("an event file never takes another one's place and comes after it", "[event_file]") {
    const ScratchFolder folder;
    EventFile first(folder.path(), stopped_clock());
    first.scalar(1, "loss", 1.0);
    EventFile second(folder.path(), stopped_clock());
    first.scalar(2, "loss", 1.0);
    REQUIRE(files(folder).size() == 2);
    CHECK(read_records(files(folder)[0]).size() == 3);
    CHECK(read_records(files(folder)[1]).size() == 1);
}

TEST_CASE("an event file that cannot be written is named in one line", "[event_file]") {
    const ScratchFolder folder;
    const std::string message =
        error_message<FileError>([&] { const EventFile events(folder / "absent"); });
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains((folder / "absent").string()) &&
                            Catch::Contains("cannot be written"));
}
