#include "apps/render/shots.h"

#include <cmath>
#include <numbers>
#include <sstream>

#include "apps/common/command_line.h"
#include "core/angle.h"
#include "core/ops/elementwise.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

constexpr int most_tiles_along = 100;

/// "FROM:TO:COUNT", in degrees; throws UsageError.
std::vector<double> parse_angles(const std::string& option, const std::string& text) {
    std::istringstream stream(text);
    double from = 0.0, to = 0.0;
    int count = 0;
    char first = 0, second = 0, rest = 0;
    stream >> from >> first >> to >> second >> count;
    const bool read = !stream.fail() && first == ':' && second == ':' && !(stream >> rest);
    if (!read || count < 1 || count > most_tiles_along || std::abs(from) > 180.0 ||
        std::abs(to) > 180.0)
        fail<UsageError>(option, " ", text,
                         ": give FROM:TO:COUNT in degrees, such as -30:30:5, of 1 to ",
                         most_tiles_along, " angles");
    std::vector<double> angles;
    for (int i = 0; i < count; ++i)
        angles.push_back(count == 1 ? from : from + (to - from) * i / (count - 1));
    return angles;
}

/// Without a list all of them.
CodeGroups groups_of(const std::string& list) {
    CodeGroups all;
    all.fill(true);
    return list.empty() ? all : parse_code_groups(list);
}

/// What the head turns around.
Eigen::Vector3d turning_point(const RenderOptions& options, const CameraConfig& camera) {
    return {0.0, 0.0, options.around == "head" ? head_middle : camera.pivot_depth};
}

Pose pose_of_degrees(const RenderOptions& options, const Model& model, double yaw, double pitch,
                     double roll) {
    const CameraConfig& camera = model.config().camera;
    return pose_from_camera(turned_camera(camera, turning_point(options, camera).z(),
                                          radians_from_degrees(yaw), radians_from_degrees(pitch),
                                          radians_from_degrees(roll), options.chosen_distance()));
}

/// The pose from the distance of the options.
Pose moved_away(const RenderOptions& options, const Model& model, const Pose& pose) {
    if (options.chosen_distance() == 1.0) return pose;
    const CameraConfig& config = model.config().camera;
    const Eigen::Vector3d point = turning_point(options, config);
    Camera camera = camera_from_pose(pose, config.intrinsics);
    camera.center = point + options.chosen_distance() * (camera.center - point);
    return pose_from_camera(camera);
}

ShotList orbit(const RenderOptions& options, const Model& model, const Codes& codes) {
    ShotList list;
    for (int frame = 0; frame < options.orbit; ++frame) {
        const double turn = 2.0 * std::numbers::pi * frame / options.orbit;
        list.shots.push_back(
            {codes, pose_of_degrees(options, model, options.orbit_yaw * std::sin(turn),
                                    options.orbit_pitch * std::cos(turn), 0.0)});
    }
    return list;
}

ShotList grid(const RenderOptions& options, const Model& model, const Codes& codes) {
    const auto angles = [](const char* name, const std::string& text,
                           const std::optional<double>& single) {
        return text.empty() ? std::vector{single.value_or(0.0)} : parse_angles(name, text);
    };
    const std::vector<double> yaws = angles("--grid-yaw", options.grid_yaw, options.yaw);
    ShotList list{.shots = {}, .columns = static_cast<int>(yaws.size())};
    for (const double pitch : angles("--grid-pitch", options.grid_pitch, options.pitch)) {
        for (const double yaw : yaws)
            list.shots.push_back(
                {codes, pose_of_degrees(options, model, yaw, pitch, options.roll.value_or(0.0))});
    }
    return list;
}

ShotList interpolation(const RenderOptions& options, const Pose& pose, const Codes& from) {
    const Codes to = read_own_codes(options.to, options.model).codes;
    ShotList list{.shots = {}, .columns = options.frames, .returning = true};
    for (int frame = 0; frame < options.frames; ++frame) {
        const double part = static_cast<double>(frame) / (options.frames - 1);
        list.shots.push_back({interpolated(from, to, part, options.take), pose});
    }
    return list;
}

}  // namespace

void require_understood(const RenderOptions& options) {
    static_cast<void>(groups_of(options.take));
    if (!options.grid_yaw.empty()) static_cast<void>(parse_angles("--grid-yaw", options.grid_yaw));
    if (!options.grid_pitch.empty())
        static_cast<void>(parse_angles("--grid-pitch", options.grid_pitch));
}

Codes interpolated(const Codes& from, const Codes& to, double part, const std::string& take) {
    const CodeGroups taken = groups_of(take);
    Codes result = from;
    for (std::size_t group = 0; group < taken.size(); ++group) {
        if (taken[group])
            result.groups[group] = from.groups[group] * (1.0 - part) + to.groups[group] * part;
    }
    return result;
}

Pose chosen_pose(const RenderOptions& options, const Model& model, const Pose& face) {
    if (!options.yaw && !options.pitch && !options.roll) return moved_away(options, model, face);
    return pose_of_degrees(options, model, options.yaw.value_or(0.0), options.pitch.value_or(0.0),
                           options.roll.value_or(0.0));
}

ShotList shots_of_face(const RenderOptions& options, const Model& model, const CodeFile& face) {
    if (options.orbit > 0) return orbit(options, model, face.codes);
    if (options.grid()) return grid(options, model, face.codes);
    const Pose pose = chosen_pose(options, model, face.pose);
    if (!options.to.empty()) return interpolation(options, pose, face.codes);
    return {.shots = {{face.codes, pose}}};
}

}  // namespace stymo
