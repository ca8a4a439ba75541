#pragma once

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "fit/photo/landmarks.h"

namespace stymo {

/// Points of a face that a person marked, by their indices among the 68.
struct MarkedPhoto {
    std::string file;  ///< name of the photo's file, without folder
    std::map<std::size_t, Eigen::Vector2d> points;
};

/// Reads {"photos": [{"file": NAME, "points": {"36": [x, y], ...}}, ...]}; the outer corners of the
/// eyes, 36 and 45, must be among the points. Throws FileError, which names the file and the
/// problem.
[[nodiscard]] std::vector<MarkedPhoto> read_marked_photos(const std::filesystem::path& path);

/// Sum and number of distances.
struct PointError {
    double sum = 0.0;
    int count = 0;

    [[nodiscard]] double mean() const { return count > 0 ? sum / count : 0.0; }
    void add(double distance) {
        sum += distance;
        ++count;
    }
};

/// Mean offset of a found point from its marked position over all photos, along the line of the
/// marked eyes and perpendicular to it (downwards). In the units of `add_errors`.
struct PointOffset {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    int count = 0;

    [[nodiscard]] Eigen::Vector2d mean() const { return sum / std::max(count, 1); }
};
/// Adds the offsets of all marked points.
void add_offsets(const MarkedPhoto& marked, const Landmarks& found,
                 std::map<std::size_t, PointOffset>& offsets);
/// The found points minus these mean offsets. It removes systematic differences, as two people, or
/// a person and a network, may define a point differently.
[[nodiscard]] Landmarks without_offsets(const MarkedPhoto& marked, Landmarks found,
                                        const std::map<std::size_t, PointOffset>& offsets);

/// Adds the distances between found and marked points, in units of the distance of the marked outer
/// corners of the eyes, to the errors of "eyes", "nose", "mouth", "chin", "brows" or "jaw", and
/// "all".
void add_errors(const MarkedPhoto& marked, const Landmarks& found,
                std::map<std::string, PointError>& errors);

}  // namespace stymo
