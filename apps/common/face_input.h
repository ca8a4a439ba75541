#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <string>

#include "nn/models/model.h"
#include "train/batch.h"
#include "train/dataset.h"

namespace stymo {

/// One photo as the tools take it: from files of its own, or with what a folder of faces knows of it.
struct FaceSource {
    std::filesystem::path image;
    std::filesystem::path mask;  ///< empty: the whole frame
    std::filesystem::path pose;  ///< a JSON file with a "pose" in degrees, such as codes.json; empty: frontal
    std::filesystem::path data;  ///< an FFHQ-format folder that has mask and pose of ...
    std::string id;              ///< ... this id
};

/// Throws UsageError unless the files name one photo: --image, or --data with --id.
void require_photo(const FaceSource& source);
/// The photo at the model's resolution. Throws FileError for what cannot be read.
[[nodiscard]] Face read_face(const FaceSource& source, const ModelConfig& config);

/// One line for each broken picture but the first `known`, which were named before: those of a set that is too large for the
/// cache come to light when they are used.
void write_broken_files(std::ostream& stream, const DatasetSummary& summary, std::size_t known);

}  // namespace stymo
