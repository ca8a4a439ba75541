#include "fit/photo/marked_points.h"

#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"

namespace stymo {
namespace {

using Json = nlohmann::json;

constexpr std::size_t left_corner = 36;
constexpr std::size_t right_corner = 45;

[[nodiscard]] std::size_t point_number(const std::string& key) {
    std::size_t number = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), number);
    if (error != std::errc() || end != key.data() + key.size() || number >= Landmarks().size())
        fail<FileError>("\"", key, "\" is not the number of a point from 0 to 67");
    return number;
}

[[nodiscard]] MarkedPhoto parse_photo(const Json& value) {
    MarkedPhoto photo{value.at("file").get<std::string>(), {}};
    for (const auto& [key, place] : value.at("points").items()) {
        const auto at = place.get<std::array<double, 2>>();
        if (!std::isfinite(at[0]) || !std::isfinite(at[1]))
            fail<FileError>("point ", key, " of ", photo.file, " is not finite");
        photo.points[point_number(key)] = {at[0], at[1]};
    }
    if (!photo.points.contains(left_corner) || !photo.points.contains(right_corner) ||
        photo.points[left_corner] == photo.points[right_corner])
        fail<FileError>(photo.file, " needs two different points 36 and 45");
    return photo;
}

[[nodiscard]] const char* group_of(std::size_t point) {
    if (point == 8) return "chin";
    if (point <= 16) return "jaw";
    if (point <= 26) return "brows";
    if (point <= 35) return "nose";
    if (point <= 47) return "eyes";
    return "mouth";
}

}  // namespace

std::vector<MarkedPhoto> read_marked_photos(const std::filesystem::path& path) {
    const std::string text = read_file(path);
    try {
        require_sound_json(text);
        std::vector<MarkedPhoto> photos;
        const Json contents = Json::parse(text);
        for (const Json& photo : contents.at("photos")) photos.push_back(parse_photo(photo));
        if (photos.empty()) fail<FileError>("\"photos\" is empty");
        return photos;
    } catch (const FileError& error) {
        fail<FileError>(path.string(), ": ", error.what());
    } catch (const Json::exception&) {
        fail<FileError>(path.string(),
                        ": not {\"photos\": [{\"file\": ..., \"points\": {\"36\": [x, y]}}]}");
    }
}

void add_offsets(const MarkedPhoto& marked, const Landmarks& found,
                 std::map<std::size_t, PointOffset>& offsets) {
    const Eigen::Vector2d across = marked.points.at(right_corner) - marked.points.at(left_corner);
    const Eigen::Vector2d down(-across.y(), across.x());
    for (const auto& [point, place] : marked.points) {
        const Eigen::Vector2d offset = (found[point] - place) / across.squaredNorm();
        offsets[point].sum += Eigen::Vector2d(offset.dot(across), offset.dot(down));
        ++offsets[point].count;
    }
}

Landmarks without_offsets(const MarkedPhoto& marked, Landmarks found,
                          const std::map<std::size_t, PointOffset>& offsets) {
    const Eigen::Vector2d across = marked.points.at(right_corner) - marked.points.at(left_corner);
    const Eigen::Vector2d down(-across.y(), across.x());
    for (const auto& [point, offset] : offsets)
        found[point] -= offset.mean().x() * across + offset.mean().y() * down;
    return found;
}

void add_errors(const MarkedPhoto& marked, const Landmarks& found,
                std::map<std::string, PointError>& errors) {
    const double unit = (marked.points.at(right_corner) - marked.points.at(left_corner)).norm();
    for (const auto& [point, place] : marked.points) {
        const double distance = (found[point] - place).norm() / unit;
        errors[group_of(point)].add(distance);
        errors["all"].add(distance);
    }
}

}  // namespace stymo
