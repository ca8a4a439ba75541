#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "render/camera.h"

namespace stymo {

/// Where a photo comes from. Empty names are not known.
struct PhotoOrigin {
    std::string person;  ///< who it is
    std::string series;  ///< photos of the person taken together, in the same light
    std::string source;  ///< photos of one look, such as those of one studio
    std::string take{};  ///< photos of the person at one moment: only the camera differs

    bool operator==(const PhotoOrigin&) const = default;
};

/// One line of `faces.jsonl`.
struct FaceRecord {
    std::optional<Pose> pose;
    std::vector<float> code;  ///< identity, expression, texture, light: 306 elements, or empty
    std::vector<Eigen::Vector2d> landmarks;  ///< 68 points in pixels of the stored image, or empty
    PhotoOrigin origin;
};

/// Parses a line into id and record: {"id", "pose": {"yaw_deg", "pitch_deg", "roll_deg", "t":
/// [x,y,z]}, "code": {"id", "expr", "tex", "light"}, "landmarks": [[x,y] x68], "person",
/// "series", "source", "take"}. All keys except the id are optional. Throws FileError for malformed
/// JSON, an unknown key, and a wrong type or length.
[[nodiscard]] std::pair<std::string, FaceRecord> parse_face_record(std::string_view line);

/// Reads "photos" of the `report.json` that stymo-prep writes: the ids of all input photos. Empty
/// for any other file.
[[nodiscard]] std::vector<std::string> read_photo_ids(const std::filesystem::path& path);

/// Reads EG3D's `dataset.json`: {"labels": [["00000/img00000000.png", [25 numbers]], ...]}, the
/// camera of each file (camera_matrices.h). Empty without labels; nothing if a label is no camera,
/// such as a class. Throws FileError for malformed JSON.
[[nodiscard]] std::optional<std::map<std::string, Camera>> read_eg3d_cameras(
    const std::filesystem::path& path);

/// Reads `camera.json`: {"focal", "cx", "cy"} in units of the image side, each optional. Throws
/// FileError for malformed JSON, an unknown key, a wrong type or a focal length out of range.
[[nodiscard]] Intrinsics read_intrinsics(const std::filesystem::path& path);
/// Writes such a `camera.json`, completely or not at all.
void write_intrinsics(const std::filesystem::path& path, const Intrinsics& intrinsics);

}  // namespace stymo
