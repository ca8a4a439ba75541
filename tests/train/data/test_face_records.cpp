#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "support/error_message.h"
#include "train/data/face_records.h"

using namespace stymo;
using namespace stymo::test;
namespace fs = std::filesystem;

namespace {

constexpr std::int64_t always = 0;

std::string line_of(const std::string& id, double yaw) {
    return R"({"id":")" + id + R"(","pose":{"yaw_deg":)" + std::to_string(yaw) +
           R"(,"pitch_deg":0.5,"roll_deg":0.25,"t":[0.125,0.0625,5.3]}})";
}

fs::path three_faces(const ScratchFolder& folder) {
    const fs::path file = folder.path() / "faces.jsonl";
    write_file(file, line_of("b c", 10.0) + "\n\n" + line_of("a", 20.0) + "\n" +
                         R"({"id":"d","person":"two words","series":"1",)"
                         R"("source":"here","take":"2"})");
    return file;
}

/// Other contents of the same size, and the same time.
void change_unnoticed(const fs::path& file) {
    const auto time = fs::last_write_time(file);
    std::string text = read_file(file);
    text.replace(text.find("20.0"), 4, "21.0");
    std::ofstream(file) << text;
    fs::last_write_time(file, time);
}

double yaw_of(const FaceRecords& records, const std::string& id) {
    return records.find(id)->pose->yaw;
}

}  // namespace

TEST_CASE("faces.jsonl is listed, and lines are read when they are asked for", "[dataset]") {
    const ScratchFolder folder;
    const FaceRecords records(three_faces(folder));
    CHECK(records.size() == 3);
    CHECK(records.find("x") == nullptr);
    CHECK_FALSE(records.find("d")->pose);
    CHECK(records.find("d")->origin == PhotoOrigin{"two words", "1", "here", "2"});
    CHECK(records.find("a")->origin == PhotoOrigin{});
    CHECK_FALSE(records.find("a")->has_code);
    CHECK(records.read("a").pose->yaw == yaw_of(records, "a"));
    CHECK(records.read("b c").pose->translation[2] == 5.3);
    CHECK_FALSE(records.read("x").pose);
    CHECK_FALSE(fs::exists(index_path(folder.path() / "faces.jsonl")));
    CHECK(FaceRecords().size() == 0);

    // Another file of this name leaves the open one as it is; changed bytes are noticed.
    fs::rename(folder.path() / "faces.jsonl", folder.path() / "old");
    write_file(folder.path() / "faces.jsonl", "");
    CHECK(records.read("a").pose);
    std::ofstream(folder.path() / "old") << std::string(300, 'x');
    CHECK_THAT(error_message<FileError>([&] { static_cast<void>(records.read("a")); }),
               Catch::Contains("has changed since it was listed, the face \"a\""));
}

TEST_CASE("the index stands for faces.jsonl until one of them changes", "[dataset]") {
    const ScratchFolder folder;
    const fs::path file = three_faces(folder);
    const FaceRecords listed(file, always);
    REQUIRE(fs::exists(index_path(file)));
    const std::string index = read_file(index_path(file));

    const FileVersion version = version_of(file);
    const std::optional<FaceEntries> read = read_face_index(file, version);
    REQUIRE(read);
    REQUIRE(read->size() == 3);
    for (const auto& [id, entry] : *read) {
        INFO(id);
        const FaceEntry& same = *listed.find(id);
        CHECK(entry.offset == same.offset);
        CHECK(entry.size == same.size);
        CHECK(entry.origin == same.origin);
        CHECK(entry.pose.has_value() == same.pose.has_value());
        if (!entry.pose) continue;
        CHECK(entry.pose->yaw == same.pose->yaw);
        CHECK(entry.pose->pitch == same.pose->pitch);
        CHECK(entry.pose->roll == same.pose->roll);
        CHECK(entry.pose->translation == same.pose->translation);
    }

    change_unnoticed(file);
    CHECK(yaw_of(FaceRecords(file, always), "a") == yaw_of(listed, "a"));
    const auto listed_anew = [&] {
        return yaw_of(FaceRecords(file, always), "a") != yaw_of(listed, "a");
    };
    SECTION("a later time") {
        fs::last_write_time(file, fs::last_write_time(file) + std::chrono::seconds(1));
        CHECK(listed_anew());
        CHECK(read_file(index_path(file)) != index);
    }
    SECTION("a damaged index") {
        std::string damaged = index;
        damaged[index.find("b c")] = 'x';
        write_file(index_path(file), damaged);
        CHECK(listed_anew());
        CHECK(read_file(index_path(file)) != damaged);
    }
    SECTION("no index") {
        for (const char* text : {"", "stymo-face-index-2", "stymo-face-index-1 x y z\n", "\n\n"}) {
            write_file(index_path(file), text);
            CHECK(listed_anew());
        }
    }
}

TEST_CASE(
    "an index that points out of its file is not used, and one that cannot be written is "
    "left out",
    "[dataset]") {
    const ScratchFolder folder;
    const fs::path file = three_faces(folder);
    const FileVersion version = version_of(file);
    for (const FaceEntry& entry : {FaceEntry{-1, 5}, FaceEntry{0, -1},
                                   FaceEntry{0, version.size + 1}, FaceEntry{version.size, 1}}) {
        write_face_index(file, version, {{"a", entry}});
        REQUIRE(fs::exists(index_path(file)));
        CHECK_FALSE(read_face_index(file, version));
    }
    fs::remove(index_path(file));
    for (const char* id : {"two\nlines", "a\ttab"}) {
        write_face_index(file, version, {{id, FaceEntry{0, 1}}});
        CHECK_FALSE(fs::exists(index_path(file)));
    }
    fs::create_directory(index_path(file));
    CHECK(FaceRecords(file, always).size() == 3);
}

TEST_CASE("a line of a face without a name is refused", "[dataset]") {
    for (const char* line : {R"({"id": ""})", R"({"id": 7})", "{}"})
        CHECK_THAT(error_message<FileError>([&] { static_cast<void>(parse_face_record(line)); }),
                   Catch::Contains("no \"id\" text"));
}
