#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "render/camera.h"

namespace stymo {

/// One line of `faces.jsonl`.
struct FaceRecord {
    std::optional<Pose> pose;
    std::vector<float> code;  ///< identity, expression, texture, light: 306 elements, or none
    std::vector<Eigen::Vector2d> landmarks;  ///< 68 points in pixels of the stored image, or none
};

/// Reads `faces.jsonl`: {"id", "pose": {"yaw_deg", "pitch_deg", "roll_deg", "t": [x,y,z]}, "code":
/// {"id", "expr", "tex", "light"}, "landmarks": [[x,y] x68]}, all but the id optional. Throws
/// FileError with file and line number for anything else: malformed JSON, an unknown key, a wrong
/// type or length, an id that comes twice.
[[nodiscard]] std::map<std::string, FaceRecord> read_face_records(
    const std::filesystem::path& path);

/// Reads "photos" of the `report.json` that stymo-prep writes: the ids of all photos that were
/// there. Empty for a file of another kind.
[[nodiscard]] std::vector<std::string> read_photo_ids(const std::filesystem::path& path);

/// Reads `camera.json`: {"focal", "cx", "cy"} in units of the image side, each optional. Throws
/// FileError as above.
[[nodiscard]] Intrinsics read_intrinsics(const std::filesystem::path& path);
/// Writes such a `camera.json`, whole or not at all.
void write_intrinsics(const std::filesystem::path& path, const Intrinsics& intrinsics);

}  // namespace stymo
