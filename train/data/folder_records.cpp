#include "train/data/folder_records.h"

#include <algorithm>
#include <array>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string_view>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"
#include "core/io/json_writer.h"
#include "nn/models/codes.h"
#include "render/camera_matrices.h"
#include "render/pose_json.h"

namespace stymo {
namespace {

using Json = nlohmann::json;

void require_keys(const Json& object, const char* what,
                  std::initializer_list<std::string_view> known) {
    if (!object.is_object()) fail<FileError>(what, " must be an object");
    for (const auto& member : object.items())
        if (std::find(known.begin(), known.end(), member.key()) == known.end())
            fail<FileError>("unknown key \"", member.key(), "\" in ", what);
}

double number_at(const Json& object, const char* key, double absent) {
    const auto found = object.find(key);
    if (found == object.end()) return absent;
    if (!found->is_number()) fail<FileError>("\"", key, "\" must be a number");
    return require_float(found->get<double>(), key);
}

std::vector<double> numbers_of(const Json& value, const char* what, std::size_t count) {
    const bool numbers =
        value.is_array() && value.size() == count &&
        std::all_of(value.begin(), value.end(), [](const Json& item) { return item.is_number(); });
    if (!numbers) fail<FileError>("\"", what, "\" must be an array of ", count, " numbers");
    std::vector<double> result;
    for (const Json& item : value) result.push_back(require_float(item.get<double>(), what));
    return result;
}

std::vector<float> code_of(const Json& value) {
    require_keys(value, "\"code\"", {code_names[0], code_names[1], code_names[2], code_names[3]});
    std::vector<float> code;
    for (std::size_t i = 0; i < code_names.size(); ++i) {
        if (!value.contains(code_names[i]))
            fail<FileError>("\"code\" lacks \"", code_names[i], "\"");
        for (const double number : numbers_of(value[code_names[i]], code_names[i],
                                              static_cast<std::size_t>(code_sizes[i])))
            code.push_back(static_cast<float>(number));
    }
    return code;
}

std::vector<Eigen::Vector2d> landmarks_of(const Json& value) {
    constexpr std::size_t count = 68;
    if (!value.is_array() || value.size() != count)
        fail<FileError>("\"landmarks\" must be an array of ", count, " points");
    std::vector<Eigen::Vector2d> landmarks;
    for (const Json& point : value) {
        const std::vector<double> xy = numbers_of(point, "landmarks", 2);
        landmarks.emplace_back(xy[0], xy[1]);
    }
    return landmarks;
}

/// A name, or an empty one where there is none.
std::string name_at(const Json& object, const char* key) {
    if (!object.contains(key)) return {};
    if (!object[key].is_string()) fail<FileError>("\"", key, "\" must be a text");
    const auto name = object[key].get<std::string>();
    if (name.find_first_of("\t\n") != std::string::npos)
        fail<FileError>("\"", key, "\" holds a tab or a line break");
    return name;
}

}  // namespace

std::pair<std::string, FaceRecord> parse_face_record(std::string_view line) {
    try {
        require_sound_json(line);
        const Json object = Json::parse(line);
        require_keys(object, "the line",
                     {"id", "pose", "code", "landmarks", "person", "series", "source", "take"});
        if (!object.contains("id") || !object["id"].is_string() ||
            object["id"].get<std::string>().empty())
            fail<FileError>("no \"id\" text");
        FaceRecord record;
        if (object.contains("pose")) record.pose = parse_pose(object["pose"].dump());
        if (object.contains("code")) record.code = code_of(object["code"]);
        if (object.contains("landmarks")) record.landmarks = landmarks_of(object["landmarks"]);
        record.origin = {name_at(object, "person"), name_at(object, "series"),
                         name_at(object, "source"), name_at(object, "take")};
        return {object["id"].get<std::string>(), std::move(record)};
    } catch (const Json::exception& error) {
        fail<FileError>("not JSON: ", plain_message(error));
    }
}

std::vector<std::string> read_photo_ids(const std::filesystem::path& path) {
    const std::string text = read_file(path);
    if (json_fault(text)) return {};
    const Json report = Json::parse(text, nullptr, false);
    if (!report.is_object() || !report.contains("photos")) return {};
    const Json& photos = report["photos"];
    const bool are_ids = photos.is_array() && std::ranges::all_of(photos, [](const Json& photo) {
                             return photo.is_string();
                         });
    return are_ids ? photos.get<std::vector<std::string>>() : std::vector<std::string>();
}

std::optional<std::map<std::string, Camera>> read_eg3d_cameras(const std::filesystem::path& path) {
    try {
        const std::string text = read_file(path);
        require_sound_json(text);
        const Json object = Json::parse(text);
        std::map<std::string, Camera> cameras;
        if (!object.is_object() || !object.contains("labels")) return std::nullopt;
        if (object["labels"].is_null()) return cameras;
        for (const Json& label : object["labels"])
            cameras.insert_or_assign(label.at(0).get<std::string>(),
                                     camera_from_eg3d(label.at(1).get<std::array<double, 25>>()));
        return cameras;
    } catch (const FileError& error) {
        fail<FileError>(path.string(), ": ", error.what());
    } catch (const Json::parse_error& error) {
        fail<FileError>(path.string(), ": not JSON: ", plain_message(error));
    } catch (const Json::exception&) {
        return std::nullopt;
    } catch (const ValueError&) {
        return std::nullopt;
    }
}

Intrinsics read_intrinsics(const std::filesystem::path& path) {
    try {
        const std::string text = read_file(path);
        require_sound_json(text);
        const Json object = Json::parse(text);
        require_keys(object, "the file", {"focal", "cx", "cy"});
        Intrinsics intrinsics;
        intrinsics.focal = number_at(object, "focal", intrinsics.focal);
        intrinsics.center_x = number_at(object, "cx", intrinsics.center_x);
        intrinsics.center_y = number_at(object, "cy", intrinsics.center_y);
        // The ranges of a model's camera.
        const auto require_between = [](const char* key, double value, double least, double most) {
            if (!(value >= least && value <= most))
                fail<FileError>('"', key, "\" is ", value,
                                ", in units of the image's side: it must be ", "in [", least, ", ",
                                most, "]");
        };
        require_between("focal", intrinsics.focal, 0.1, 100.0);
        require_between("cx", intrinsics.center_x, -1.0, 2.0);
        require_between("cy", intrinsics.center_y, -1.0, 2.0);
        return intrinsics;
    } catch (const FileError& error) {
        fail<FileError>(path.string(), ": ", error.what());
    } catch (const Json::exception& error) {
        fail<FileError>(path.string(), ": not JSON: ", plain_message(error));
    }
}

void write_intrinsics(const std::filesystem::path& path, const Intrinsics& intrinsics) {
    const JsonValue camera = JsonValue::object(
        {{"focal", intrinsics.focal}, {"cx", intrinsics.center_x}, {"cy", intrinsics.center_y}});
    write_file(path, camera.text() + "\n");
}

}  // namespace stymo
