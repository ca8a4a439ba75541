#include <iomanip>
#include <map>
#include <optional>
#include <sstream>

#include "apps/landmarks/commands.h"
#include "core/error.h"
#include "core/io/image.h"
#include "fit/photo/face_detector.h"
#include "fit/photo/marked_points.h"
#include "nn/pretrained/face_square.h"

namespace stymo::landmarks {
namespace {

namespace fs = std::filesystem;

using Errors = std::map<std::string, PointError>;

void mark(Tensor& image, const Eigen::Vector2d& point, const std::array<float, 3>& color) {
    const auto values = image.mutable_values<float>();
    for (std::int64_t step = -2; step <= 2; ++step)
        for (const bool across : {false, true}) {
            const std::int64_t column = std::llround(point.x() - 0.5) + (across ? step : 0);
            const std::int64_t row = std::llround(point.y() - 0.5) + (across ? 0 : step);
            if (row < 0 || column < 0 || row >= image.shape(0) || column >= image.shape(1))
                continue;
            std::ranges::copy(color, values.begin() + 3 * (row * image.shape(1) + column));
        }
}

/// The face enlarged, with found points in yellow and marked ones in red.
void write_overlay(const fs::path& path, const Tensor& photo, const MarkedPhoto& marked,
                   const Landmarks& found) {
    constexpr std::int64_t side = 480;
    const FaceSquare square = square_around(found);
    Tensor image = image_in_square(photo, square, side);
    const auto place = [&](const Eigen::Vector2d& point) -> Eigen::Vector2d {
        return 0.5 * side * (square.coordinates(point) + Eigen::Vector2d::Ones());
    };
    for (const Eigen::Vector2d& point : found) mark(image, place(point), {1.0F, 1.0F, 0.0F});
    for (const auto& [number, point] : marked.points) mark(image, place(point), {1.0F, 0.0F, 0.0F});
    write_image(path, image);
}

/// The detected face whose landmarks are nearest to the marked eyes.
const DetectedFace& face_of(const std::vector<DetectedFace>& faces, const MarkedPhoto& marked) {
    const auto distance = [&](const DetectedFace& face) {
        return (face.landmarks[36] - marked.points.at(36)).norm() +
               (face.landmarks[45] - marked.points.at(45)).norm();
    };
    return *std::ranges::min_element(
        faces, [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
}

struct Measured {
    MarkedPhoto marked;
    Landmarks found;
};

/// Finds the face of each photo. A photo without a face adds a line to `text`.
std::vector<Measured> find_all(const MeasureOptions& options, std::ostream& text) {
    const std::vector<MarkedPhoto> photos = read_marked_photos(options.marked);
    const FaceDetector detector(options.model);
    if (!options.overlays.empty()) fs::create_directories(options.overlays);
    std::vector<Measured> all;
    for (const MarkedPhoto& marked : photos) {
        const Tensor photo = read_image(options.photos / marked.file);
        const std::vector<DetectedFace> faces = detector.find(photo);
        if (faces.empty()) {
            text << marked.file << ": no face was found\n";
            continue;
        }
        all.push_back({marked, face_of(faces, marked).landmarks});
        const fs::path name = fs::path(marked.file).stem().string() + ".png";
        if (!options.overlays.empty())
            write_overlay(options.overlays / name, photo, marked, all.back().found);
    }
    if (all.empty()) fail<ValueError>(options.photos.string(), ": no face was found");
    return all;
}

/// A table of the groups of points, with what all photos have in common and without it.
std::vector<JsonValue> group_rows(const std::vector<Measured>& all,
                                  const std::map<std::size_t, PointOffset>& offsets,
                                  std::ostream& text) {
    Errors errors, rest;
    for (const auto& [marked, found] : all) {
        add_errors(marked, found, errors);
        add_errors(marked, without_offsets(marked, found, offsets), rest);
    }
    text << "mean distance in percent of the distance of the outer corners of the eyes, and the\n"
            "same without the mean offset of each point\n";
    std::vector<JsonValue> rows;
    for (const auto& [name, error] : errors) {
        text << std::setw(6) << name << std::setw(8) << 100.0 * error.mean() << std::setw(8)
             << 100.0 * rest[name].mean() << "  (" << error.count << " points)\n";
        rows.push_back(JsonValue::object({{"group", name},
                                          {"error", error.mean()},
                                          {"without_offset", rest[name].mean()},
                                          {"points", error.count}}));
    }
    return rows;
}

AppResult measure(const MeasureOptions& options) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(2);
    const std::vector<Measured> all = find_all(options, text);
    std::map<std::size_t, PointOffset> offsets;
    std::vector<JsonValue> photos, points;
    for (const auto& [marked, found] : all) {
        Errors own;
        add_errors(marked, found, own);
        add_offsets(marked, found, offsets);
        text << marked.file << ": " << 100.0 * own["all"].mean() << " %\n";
        photos.push_back(JsonValue::object({{"file", marked.file}, {"error", own["all"].mean()}}));
    }
    const std::vector<JsonValue> groups = group_rows(all, offsets, text);
    for (const auto& [point, offset] : offsets)
        points.push_back(JsonValue::object(
            {{"point", point}, {"right", offset.mean().x()}, {"down", offset.mean().y()}}));
    return {text.str(),
            JsonValue::object({{"photos", photos}, {"groups", groups}, {"offsets", points}})};
}

}  // namespace

void declare_measure(CommandLine& line, MeasureOptions& options) {
    Command command = line.command("measure", "Compares found landmarks with marked ones.",
                                   [&](const CommonOptions&) { return measure(options); });
    command.option("--marked", options.marked, "JSON file of marked points").required();
    command.option("--photos", options.photos, "folder of the photos").required();
    command.option("--model", options.model,
                   "landmark network, or dlib's model (default: that of libdlib-data)");
    command.option("--overlays", options.overlays,
                   "folder for images with found (yellow) and marked (red) points");
}

}  // namespace stymo::landmarks
