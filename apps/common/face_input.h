#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

#include "nn/models/model.h"
#include "train/data/batch.h"
#include "train/data/dataset.h"

namespace stymo {

/// The photo of a tool: an unprepared photo, an aligned photo with files for mask and pose, or a
/// face of a data set.
struct FaceSource {
    std::vector<std::string> images;  ///< several only if unprepared, of one person
    std::filesystem::path mask;       ///< empty: the whole frame
    std::filesystem::path
        pose;  ///< a JSON file with a "pose" in degrees, such as codes.json; empty: frontal
    std::filesystem::path data;  ///< an FFHQ-format folder that has mask and pose of ...
    std::string id;              ///< ... this id
    bool as_is = false;          ///< the photo is an aligned crop, its face frontal, all of it head

    /// Whether the photos are unprepared, so that fit/photo must prepare them.
    [[nodiscard]] bool as_it_comes() const {
        return mask.empty() && pose.empty() && data.empty() && !as_is;
    }
};

/// Throws UsageError unless a photo is given by --image, or by --data with --id, and unless a photo
/// with known mask or pose is the only one.
void require_photo(const FaceSource& source);
/// The middle of an image at the model's resolution.
[[nodiscard]] Tensor at_model_side(const Tensor& image, std::int64_t side);
/// A photo with known mask or pose, at the model's resolution. Throws FileError if a file cannot be
/// read.
[[nodiscard]] Face read_face(const FaceSource& source, const ModelConfig& config);

/// One line for each broken image but the first `known`, which were named before: those of a set
/// that is too large for the cache come to light when they are used.
void write_broken_files(std::ostream& stream, const DatasetSummary& summary, std::size_t known);

}  // namespace stymo
