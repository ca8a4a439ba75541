#include "train/data/face_records.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/io/json_check.h"
#include "nn/models/codes.h"
#include "render/pose_json.h"
#include "train/data/face_index.h"
#include "train/data/json_values.h"

namespace stymo {
namespace {

using Json = nlohmann::json;

std::vector<double> numbers_of(const Json& value, const char* what, std::size_t count) {
    const bool numbers =
        value.is_array() && value.size() == count &&
        std::all_of(value.begin(), value.end(), [](const Json& item) { return item.is_number(); });
    if (!numbers) fail<FileError>("\"", what, "\" must be an array of ", count, " numbers");
    std::vector<double> result;
    for (const Json& item : value) result.push_back(finite_number(item, what));
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

bool is_blank(std::string_view line) {
    return line.find_first_not_of(" \t\r") == std::string_view::npos;
}

/// Lists the lines of a file one by one.
class Listing {
public:
    explicit Listing(const std::filesystem::path& path) : path_(path) {}

    void add(std::string_view part) {
        for (std::size_t end = part.find('\n'); end != std::string_view::npos;
             end = part.find('\n')) {
            line_ += part.substr(0, end);
            finish_line();
            ++offset_;
            part.remove_prefix(end + 1);
        }
        line_ += part;
    }
    [[nodiscard]] FaceEntries entries() && {
        finish_line();
        return std::move(entries_);
    }

private:
    void finish_line() {
        const auto size = std::ssize(line_);
        ++number_;
        if (!is_blank(line_)) {
            try {
                auto [id, record] = parse_face_record(line_);
                const FaceEntry entry{offset_, size, !record.code.empty(),
                                      !record.landmarks.empty(), record.pose};
                if (!entries_.emplace(id, entry).second)
                    fail<FileError>("the id \"", id, "\" comes twice");
            } catch (const FileError& error) {
                fail<FileError>(path_.string(), ", line ", number_, ": ", error.what());
            }
        }
        offset_ += size;
        line_.clear();
    }

    const std::filesystem::path& path_;
    std::string line_;
    std::int64_t offset_ = 0;  ///< of the line
    std::int64_t number_ = 0;
    FaceEntries entries_;
};

}  // namespace

std::pair<std::string, FaceRecord> parse_face_record(std::string_view line) {
    try {
        require_sound_json(line);
        const Json object = Json::parse(line);
        require_keys(object, "the line", {"id", "pose", "code", "landmarks"});
        if (!object.contains("id") || !object["id"].is_string()) fail<FileError>("no \"id\" text");
        FaceRecord record;
        if (object.contains("pose")) record.pose = parse_pose(object["pose"].dump());
        if (object.contains("code")) record.code = code_of(object["code"]);
        if (object.contains("landmarks")) record.landmarks = landmarks_of(object["landmarks"]);
        return {object["id"].get<std::string>(), std::move(record)};
    } catch (const Json::exception& error) {
        fail<FileError>("not JSON: ", plain_message(error));
    }
}

FaceRecords::FaceRecords(const std::filesystem::path& file, std::int64_t index_from)
    : path_(file), file_(file) {
    const FileVersion version = version_of(file);
    const bool indexed = version.size >= index_from;
    if (indexed) {
        if (std::optional<FaceEntries> entries = read_face_index(file, version)) {
            entries_ = std::move(*entries);
            return;
        }
    }
    Listing listing(file);
    read_parts(file, [&](std::string_view part) { listing.add(part); });
    entries_ = std::move(listing).entries();
    if (indexed && version_of(file) == version) write_face_index(file, version, entries_);
}

const FaceEntry* FaceRecords::find(const std::string& id) const {
    const auto found = entries_.find(id);
    return found == entries_.end() ? nullptr : &found->second;
}

FaceRecord FaceRecords::read(const std::string& id) const {
    const FaceEntry* entry = find(id);
    if (entry == nullptr) return {};
    try {
        auto [found, record] = parse_face_record(file_->read(entry->offset, entry->size));
        if (found == id) return std::move(record);
    } catch (const FileError&) {
    }
    fail<FileError>(path_.string(), ": has changed since it was listed, the face \"", id,
                    "\" is not where it was; start again");
}

}  // namespace stymo
