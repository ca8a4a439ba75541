#include "apps/prep/camera_file.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"
#include "render/camera_matrices.h"
#include "render/pose_json.h"
#include "train/data/folder_records.h"

namespace stymo {
namespace {

using Json = nlohmann::json;

/// All numbers of nested arrays in order.
void append_numbers(const Json& value, std::vector<double>& numbers) {
    if (value.is_number()) {
        numbers.push_back(value.get<double>());
    } else if (value.is_array()) {
        for (const Json& item : value) append_numbers(item, numbers);
    } else {
        fail<FileError>("holds something else than numbers");
    }
}

/// Numbers between spaces and commas; none if there is anything else.
std::vector<double> plain_numbers(std::string text) {
    std::ranges::replace(text, ',', ' ');
    std::istringstream stream(text);
    std::vector<double> numbers;
    for (double number = 0.0; stream >> number;) numbers.push_back(number);
    if (!stream.eof()) return {};
    return numbers;
}

Camera camera_from_numbers(const std::vector<double>& numbers, const Intrinsics& intrinsics) {
    if (numbers.size() == 25) return camera_from_eg3d(std::span<const double, 25>(numbers));
    // The files have their rows one after the other; Eigen's own order is by columns.
    if (numbers.size() == 16) {
        const Eigen::Matrix4d transposed(numbers.data());
        return camera_from_matrix(Eigen::Matrix4d(transposed.transpose()), intrinsics);
    }
    if (numbers.size() == 12) {
        const Eigen::Matrix<double, 4, 3> transposed(numbers.data());
        return camera_from_matrix(Eigen::Matrix<double, 3, 4>(transposed.transpose()), intrinsics);
    }
    fail<FileError>("holds ", numbers.size(),
                    " numbers; 25 (EG3D), 16 (4x4) or 12 (3x4) make a camera");
}

/// Those of the object's "camera", as `stymo-prep pose` writes them; what it lacks is
/// `otherwise`'s.
Intrinsics intrinsics_of(const Json& object, const Intrinsics& otherwise) {
    if (!object.contains("camera") || !object["camera"].is_object()) return otherwise;
    const auto number = [&](const char* key, double usual) {
        const Json& camera = object["camera"];
        if (!camera.contains(key)) return usual;
        if (!camera[key].is_number()) fail<FileError>("\"camera\": \"", key, "\" is not a number");
        return camera[key].get<double>();
    };
    const double focal = number("focal", otherwise.focal);
    if (!(focal > 0.0)) fail<FileError>("\"camera\": the focal length ", focal, " is not positive");
    return {.focal = focal,
            .center_x = number("cx", otherwise.center_x),
            .center_y = number("cy", otherwise.center_y)};
}

/// The label of an image in EG3D's dataset.json: {"labels": [["00000/img00000000.png", [25
/// numbers]], ...]}.
const Json& label_of(const Json& labels, const std::string& id) {
    if (id.empty()) fail<FileError>("holds many poses; name one with --id");
    for (const Json& entry : labels)
        if (entry.is_array() && entry.size() == 2 && entry[0] == id) return entry[1];
    fail<FileError>("holds no label of ", id);
}

Camera camera_from_json(const Json& value, const std::string& id, const Intrinsics& intrinsics) {
    if (value.is_object() && value.contains("labels"))
        return camera_from_json(label_of(value["labels"], id), {}, intrinsics);
    if (!id.empty() && (!value.is_object() || !value.contains("id") || value["id"] != id))
        fail<FileError>("holds no face with the id ", id);
    if (value.is_object()) {
        return camera_from_pose(parse_pose((value.contains("pose") ? value["pose"] : value).dump()),
                                intrinsics_of(value, intrinsics));
    }
    std::vector<double> numbers;
    append_numbers(value, numbers);
    return camera_from_numbers(numbers, intrinsics);
}

/// The line of faces.jsonl with this id, if the text is such a file.
std::optional<Json> record_of(const std::string& text, const std::string& id) {
    std::istringstream stream(text);
    bool lines = false;
    for (std::string line; std::getline(stream, line);) {
        if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
        const Json value = Json::parse(line, nullptr, false);
        if (!value.is_object() || !value.contains("id")) return std::nullopt;
        if (value["id"] == id) return value;
        lines = true;
    }
    if (!lines) return std::nullopt;
    if (id.empty()) fail<FileError>("holds many poses; name one with --id");
    fail<FileError>("holds no face with the id ", id);
}

Camera camera_in(const std::string& text, const std::string& id, const Intrinsics& intrinsics) {
    require_sound_json(text);
    const Json value = Json::parse(text, nullptr, false);
    if (!value.is_discarded()) return camera_from_json(value, id, intrinsics);
    if (const std::optional<Json> record = record_of(text, id))
        return camera_from_json(*record, id, intrinsics);
    const std::vector<double> numbers = plain_numbers(text);
    if (numbers.empty()) fail<FileError>("neither JSON nor numbers");
    if (!id.empty()) fail<FileError>("holds no face with the id ", id);
    return camera_from_numbers(numbers, intrinsics);
}

}  // namespace

Camera read_camera(const std::filesystem::path& path, const std::string& id,
                   const Intrinsics& intrinsics) {
    const std::string text = read_file(path);
    const std::filesystem::path of_folder = path.parent_path() / "camera.json";
    const bool has_own = path.filename() == "faces.jsonl" && std::filesystem::exists(of_folder);
    const Intrinsics usual = has_own ? read_intrinsics(of_folder) : intrinsics;
    try {
        return camera_in(text, id, usual);
    } catch (const Error& error) {
        fail<FileError>(path.string(), ": ", error.what());
    }
}

}  // namespace stymo
