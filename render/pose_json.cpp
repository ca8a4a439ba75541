#include "render/pose_json.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/angle.h"
#include "core/error.h"
#include "core/io/json_check.h"

namespace stymo {
namespace {

using Json = nlohmann::json;

constexpr std::array<const char*, 4> keys{"yaw_deg", "pitch_deg", "roll_deg", "t"};

double number(const Json& value, const char* key) {
    if (!value.is_number()) fail<FileError>("\"", key, "\" is not a number");
    return require_float(value.get<double>(), key);
}

}  // namespace

JsonValue to_json(const Pose& pose) {
    return JsonValue::object(
        {{"yaw_deg", degrees_from_radians(pose.yaw)},
         {"pitch_deg", degrees_from_radians(pose.pitch)},
         {"roll_deg", degrees_from_radians(pose.roll)},
         {"t", std::vector<double>(pose.translation.begin(), pose.translation.end())}});
}

Pose parse_pose(std::string_view json) {
    require_sound_json(json);
    const Json pose = Json::parse(json, nullptr, false);
    if (!pose.is_object()) fail<FileError>("\"pose\" is not an object");
    for (const char* key : keys)
        if (!pose.contains(key)) fail<FileError>("\"", key, "\" is missing in \"pose\"");
    for (const auto& member : pose.items())
        if (std::ranges::find(keys, member.key()) == keys.end())
            fail<FileError>("unknown key \"", member.key(), "\" in \"pose\"");
    const auto angle = [&](const char* key) {
        constexpr double full_turn = 360.0;
        const double degrees = number(pose[key], key);
        if (std::abs(degrees) > full_turn)
            fail<FileError>("\"", key, "\" is ", degrees, ", expected -360 to 360");
        return radians_from_degrees(degrees);
    };
    const Json& t = pose["t"];
    if (!t.is_array() || t.size() != 3) fail<FileError>("\"t\" is not an array of 3 numbers");
    const double yaw = angle("yaw_deg"), pitch = angle("pitch_deg"), roll = angle("roll_deg");
    const Eigen::Vector3d center(number(t[0], "t"), number(t[1], "t"), number(t[2], "t"));
    constexpr double nearest = 0.1, farthest = 1e4;
    if (!(center.norm() >= nearest && center.norm() <= farthest))
        fail<FileError>("\"t\" is ", center.norm(), " from the head, expected ", nearest, " to ",
                        farthest);
    return {yaw, pitch, roll, center};
}

}  // namespace stymo
