#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/error.h"
#include "render/pose_json.h"
#include "support/error_message.h"

using namespace stymo;
using namespace stymo::test;

namespace {

const Pose some_pose{0.3, -0.1, 0.02, {0.5, -0.25, 5.125}};

std::string refusal(const std::string& text) {
    return error_message<FileError>([&] { static_cast<void>(parse_pose(text)); });
}

}  // namespace

TEST_CASE("a pose is written in degrees and reads back") {
    const nlohmann::json json = nlohmann::json::parse(to_json(some_pose).text());
    CHECK(json["yaw_deg"].get<double>() == Approx(0.3 * 180.0 / std::numbers::pi));
    CHECK(json["t"] == nlohmann::json{0.5, -0.25, 5.125});
    const Pose read = parse_pose(json.dump());
    CHECK(read.yaw == Approx(some_pose.yaw).epsilon(1e-14));
    CHECK(read.pitch == Approx(some_pose.pitch).epsilon(1e-14));
    CHECK(read.roll == Approx(some_pose.roll).epsilon(1e-14));
    CHECK(read.translation == some_pose.translation);
}

TEST_CASE("a pose with a key that is missing, unknown or no number is refused by the key") {
    const nlohmann::json complete = nlohmann::json::parse(to_json(some_pose).text());
    for (const char* key : {"yaw_deg", "pitch_deg", "roll_deg", "t"}) {
        const std::string quoted = std::string("\"") + key + "\"";
        nlohmann::json json = complete;
        json[key] = "0";
        CHECK_THAT(refusal(json.dump()), Catch::Contains(quoted + " is not"));
        json.erase(key);
        CHECK_THAT(refusal(json.dump()), Catch::Contains(quoted + " is missing"));
    }
    nlohmann::json json = complete;
    json["yaw"] = 3;
    CHECK_THAT(refusal(json.dump()), Catch::Contains("unknown key \"yaw\""));
    json = complete;
    json["t"] = {0, 0};
    CHECK_THAT(refusal(json.dump()), Catch::Contains("\"t\" is not an array of 3"));
    json["t"] = {0, 0, 1e300};
    CHECK_THAT(refusal(json.dump()),
               Catch::Contains("\"t\" holds") && Catch::Contains("too large"));
    json["t"] = {0, 0, 1e20};
    CHECK_THAT(refusal(json.dump()), Catch::Contains("\"t\" is 1e+20 from the head"));
    json["t"] = {0, 0, 0};
    CHECK_THAT(refusal(json.dump()), Catch::Contains("\"t\" is 0 from the head"));
    json = complete;
    json["pitch_deg"] = -400;
    CHECK_THAT(refusal(json.dump()),
               Catch::Contains("\"pitch_deg\" is -400, expected -360 to 360"));
    for (const char* text : {"", "3", "[]", "null", "{"})
        CHECK_THAT(refusal(text), Catch::Contains("not an object"));
}
