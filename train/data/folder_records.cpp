#include "train/data/folder_records.h"

#include <algorithm>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"
#include "core/io/json_writer.h"
#include "train/data/json_values.h"

namespace stymo {
namespace {

using Json = nlohmann::json;

double number_at(const Json& object, const char* key, double absent) {
    const auto found = object.find(key);
    if (found == object.end()) return absent;
    if (!found->is_number()) fail<FileError>("\"", key, "\" must be a number");
    return finite_number(*found, key);
}

}  // namespace

std::vector<std::string> read_photo_ids(const std::filesystem::path& path) {
    const std::string text = read_text_file(path);
    if (json_fault(text)) return {};
    const Json report = Json::parse(text, nullptr, false);
    if (!report.is_object() || !report.contains("photos")) return {};
    const Json& photos = report["photos"];
    const bool are_ids = photos.is_array() && std::ranges::all_of(photos, [](const Json& photo) {
                             return photo.is_string();
                         });
    return are_ids ? photos.get<std::vector<std::string>>() : std::vector<std::string>();
}

Intrinsics read_intrinsics(const std::filesystem::path& path) {
    try {
        const std::string text = read_text_file(path);
        require_sound_json(text);
        const Json object = Json::parse(text);
        require_keys(object, "the file", {"focal", "cx", "cy"});
        Intrinsics intrinsics;
        intrinsics.focal = number_at(object, "focal", intrinsics.focal);
        intrinsics.center_x = number_at(object, "cx", intrinsics.center_x);
        intrinsics.center_y = number_at(object, "cy", intrinsics.center_y);
        constexpr double largest_focal = 100.0;
        if (!(intrinsics.focal > 0.0) || intrinsics.focal > largest_focal)
            fail<FileError>("\"focal\" is ", intrinsics.focal,
                            ": it must be positive, in units of the image's side, at most ",
                            largest_focal);
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
    write_text_file(path, camera.text() + "\n");
}

}  // namespace stymo
