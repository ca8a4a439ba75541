#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <span>
#include <string>
#include <vector>

#include "nn/models/face_batch.h"
#include "nn/models/model.h"
#include "train/data/dataset.h"

namespace stymo {

/// The photo of a tool: an unprepared photo, an aligned photo with files for mask and pose, or a
/// face of a data set.
struct FaceSource {
    std::vector<std::string>
        images;                    ///< several are allowed only if unprepared, and show one person
    std::filesystem::path mask;    ///< mask file; empty: the whole frame
    std::filesystem::path ignore;  ///< white where nothing is known of the face; empty: nowhere
    /// A JSON file with a "pose" in degrees, such as codes.json; empty: frontal.
    std::filesystem::path pose;
    std::filesystem::path data;  ///< a folder in the FFHQ format with mask and pose of `id`
    std::string id;              ///< face of `data`
    bool as_is = false;          ///< the photo is an aligned crop of a frontal face without mask

    /// Whether the photos are unprepared and need fit/photo.
    [[nodiscard]] bool as_it_comes() const {
        return mask.empty() && pose.empty() && data.empty() && !as_is;
    }
};

/// Throws UsageError unless there is --image, or --data with --id. Also throws it if there are
/// several photos with known mask or pose, or with --ignore.
void require_photo(const FaceSource& source);
/// read_image, with a warning on stderr if the colours could not be converted to sRGB.
[[nodiscard]] Tensor read_image_of_user(const std::filesystem::path& path);
/// The known pixels (nn/known_pixels.h) of the photo of --ignore, in its own frame; undefined: all.
/// Throws FileError if the file cannot be read or covers the whole photo.
[[nodiscard]] Tensor read_known(const FaceSource& source);
/// A photo with known mask or pose, at the model's resolution. Throws FileError if a file cannot be
/// read.
[[nodiscard]] Face read_face(const FaceSource& source, const ModelConfig& config);

/// Names what is no image in a data set's folder.
void write_left_out(std::ostream& stream, std::span<const BrokenFile> left_out);
/// Writes one line for each broken image except the first `known`, which were already reported. (If
/// a data set is too large for the cache, broken images are found only when they are used.)
void write_broken_files(std::ostream& stream, const DatasetSummary& summary, std::size_t known);

}  // namespace stymo
