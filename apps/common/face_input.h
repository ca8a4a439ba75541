#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

#include "nn/models/model.h"
#include "train/batch.h"
#include "train/dataset.h"

namespace stymo {

/// A photo as the tools take it: as it comes, from files of its own, or with what a folder of faces knows of it.
struct FaceSource {
    std::vector<std::string> images;  ///< several only as they come, of one person
    std::filesystem::path mask;       ///< empty: the whole frame
    std::filesystem::path pose;       ///< a JSON file with a "pose" in degrees, such as codes.json; empty: frontal
    std::filesystem::path data;       ///< an FFHQ-format folder that has mask and pose of ...
    std::string id;                   ///< ... this id
    bool as_is = false;               ///< the photo is an aligned crop, its face frontal, all of it head

    /// Whether nothing is known of the photos, so that they are to be prepared (fit/photo).
    [[nodiscard]] bool as_it_comes() const { return mask.empty() && pose.empty() && data.empty() && !as_is; }
};

/// Throws UsageError unless there is a photo, --image or --data with --id, and only one if something is known of it.
void require_photo(const FaceSource& source);
/// The middle of an image at the model's resolution.
[[nodiscard]] Tensor at_model_side(const Tensor& image, std::int64_t side);
/// A photo of which something is known, at the model's resolution. Throws FileError for what cannot be read.
[[nodiscard]] Face read_face(const FaceSource& source, const ModelConfig& config);

/// One line for each broken picture but the first `known`, which were named before: those of a set that is too large for the
/// cache come to light when they are used.
void write_broken_files(std::ostream& stream, const DatasetSummary& summary, std::size_t known);

}  // namespace stymo
