#include <catch2/catch.hpp>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "nn/models/code_file.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

const Pose some_pose{0.3, -0.1, 0.02, {0.5, -0.25, 5.125}};

nlohmann::json some_json() {
    const ScratchFolder folder;
    write_code_file(folder / "codes.json", random_codes(1, 1), 0, some_pose);
    return nlohmann::json::parse(read_file(folder / "codes.json"));
}

std::string refusal(const std::string& text) {
    const ScratchFolder folder;
    write_file(folder / "codes.json", text);
    std::string message =
        error_message<FileError>([&] { static_cast<void>(read_code_file(folder / "codes.json")); });
    INFO(text.substr(0, 100));
    CHECK(is_one_line(message));
    CHECK_THAT(message, Catch::Contains((folder / "codes.json").string()));
    return message;
}

std::string refusal_after(const std::function<void(nlohmann::json&)>& change) {
    nlohmann::json json = some_json();
    change(json);
    return refusal(json.dump());
}

}  // namespace

TEST_CASE("codes read back bit for bit and the pose to the last digits", "[code_file]") {
    const ScratchFolder folder;
    const Codes codes = random_codes(3, 1);
    write_code_file(folder / "codes.json", codes, 2, some_pose);
    const CodeFile read = read_code_file(folder / "codes.json");
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        const std::vector<double> all = codes.groups[group].value().to_vector();
        const auto size = static_cast<std::ptrdiff_t>(code_sizes[group]);
        CHECK(read.codes.groups[group].shape() == Shape{1, code_sizes[group]});
        CHECK(read.codes.groups[group].dtype() == DType::float32);
        CHECK(read.codes.groups[group].value().to_vector() ==
              std::vector<double>(all.begin() + 2 * size, all.begin() + 3 * size));
    }
    for (const Pose& pose : {read.pose, read_pose(folder / "codes.json")}) {
        CHECK(pose.yaw == Approx(some_pose.yaw).epsilon(1e-14));
        CHECK(pose.pitch == Approx(some_pose.pitch).epsilon(1e-14));
        CHECK(pose.roll == Approx(some_pose.roll).epsilon(1e-14));
        CHECK(pose.translation == some_pose.translation);
    }
}

TEST_CASE("codes that no reader takes are not written, and the file before stays", "[code_file]") {
    const ScratchFolder folder;
    const std::filesystem::path file = folder / "codes.json";
    write_code_file(file, random_codes(1, 1), 0, Pose{});
    const std::string before = read_file(file);
    for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), 1e31}) {
        Codes codes = random_codes(1, 1);
        codes.groups[2] = codes.groups[2] * wrong;
        CHECK_THROWS_AS(write_code_file(file, codes, 0, Pose{}), NumericError);
    }
    CHECK(read_file(file) == before);
}

TEST_CASE("a pose is read from any object that has one", "[code_file]") {
    const ScratchFolder folder;
    write_file(folder / "p.json",
               R"({"id": "7",
            "pose": {"yaw_deg": 90, "pitch_deg": -45, "roll_deg": 180, "t": [1, 2, 3]}})");
    const Pose pose = read_pose(folder / "p.json");
    CHECK(pose.yaw == Approx(std::numbers::pi / 2.0));
    CHECK(pose.pitch == Approx(-std::numbers::pi / 4.0));
    CHECK(pose.roll == Approx(std::numbers::pi));
    CHECK(pose.translation == Eigen::Vector3d{1.0, 2.0, 3.0});
}

TEST_CASE("a malformed code file is refused in one line with file and key", "[code_file]") {
    const ScratchFolder folder;
    CHECK(is_one_line(error_message<FileError>(
        [&] { static_cast<void>(read_code_file(folder / "missing.json")); })));
    for (const char* text : {"", "{", "codes", "{\"code\": 1e999}", "\xff\xfe"})
        CHECK_THAT(refusal(text), Catch::Contains("not JSON"));
    CHECK_THAT(refusal_after([&](auto& json) { json["model"] = 5; }),
               Catch::Contains("\"model\" is no text"));
    for (const char* text : {"{}", "[]", "null", "3", "[{\"code\": 1}]"})
        CHECK_THAT(refusal(text), Catch::Contains("\"code\" is missing"));
    for (const char* group : code_names) {
        const std::string quoted = std::string("\"") + group + "\"";
        CHECK_THAT(refusal_after([&](auto& json) { json["code"].erase(group); }),
                   Catch::Contains(quoted + " is missing"));
        CHECK_THAT(refusal_after([&](auto& json) { json["code"][group].push_back(0.5); }),
                   Catch::Contains(quoted + " is not an array of"));
        CHECK_THAT(refusal_after([&](auto& json) { json["code"][group] = "zeros"; }),
                   Catch::Contains(quoted + " is not an array of"));
        CHECK_THAT(refusal_after([&](auto& json) { json["code"][group][3] = "0"; }),
                   Catch::Contains(quoted + " is not a number"));
        CHECK_THAT(refusal_after([&](auto& json) { json["code"][group][3] = nullptr; }),
                   Catch::Contains(quoted + " is not a number"));
        CHECK_THAT(refusal_after([&](auto& json) { json["code"][group][3] = -1e37; }),
                   Catch::Contains(quoted + " holds -1e+37, which is too large"));
    }
    CHECK_THAT(refusal_after([](auto& json) { json.erase("pose"); }),
               Catch::Contains("\"pose\" is missing"));
    CHECK_THAT(refusal_after([](auto& json) { json["pose"] = 3; }),
               Catch::Contains("\"pose\" is not an object"));
    CHECK_THAT(refusal_after([](auto& json) { json["pose"].erase("roll_deg"); }),
               Catch::Contains("\"roll_deg\" is missing"));
}

TEST_CASE("a code file below a regular file is not written", "[code_file]") {
    const ScratchFolder folder;
    write_file(folder / "file", "");
    CHECK(is_one_line(error_message<FileError>([&] {
        write_code_file(folder / "file" / "codes.json", random_codes(1, 1), 0, some_pose);
    })));
    CHECK(folder.file_count() == 1);
}

TEST_CASE("a code file that is nested deeply is refused") {
    const std::string deep(200000, '['), end(200000, ']');
    CHECK_THROWS_AS(parse_code_file("{\"pose\": " + deep + end + "}", "deep"), FileError);
    CHECK_THROWS_AS(parse_code_file(deep, "deep"), FileError);
}
