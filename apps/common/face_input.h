#pragma once

#include <filesystem>
#include <string>

#include "nn/models/model.h"
#include "train/batch.h"

namespace stymo {

/// One photo as the tools take it: from files of its own, or with what a folder of faces knows of it.
struct FaceSource {
    std::filesystem::path image;
    std::filesystem::path mask;  ///< empty: the whole frame
    std::filesystem::path pose;  ///< a JSON file with a "pose" in degrees, such as codes.json; empty: frontal
    std::filesystem::path data;  ///< an FFHQ-format folder that has mask and pose of ...
    std::string id;              ///< ... this id
};

/// The photo at the model's resolution. Throws FileError for what cannot be read.
[[nodiscard]] Face read_face(const FaceSource& source, const ModelConfig& config);

}  // namespace stymo
