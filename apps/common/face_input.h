#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "nn/models/model.h"
#include "train/batch.h"

namespace stymo {

/// One photo as the tools take it: from files of its own, or by id from a folder of faces.
struct FaceSource {
    std::filesystem::path image;
    std::filesystem::path mask;  ///< empty: the whole frame
    std::filesystem::path pose;  ///< a JSON file with a "pose"; empty: frontal
    std::filesystem::path data;  ///< an FFHQ-format folder ...
    std::string id;              ///< ... and the id in it, for mask and pose
};

/// The photo at the model's resolution with mask, pose and intrinsics. Throws FileError for what cannot be read.
[[nodiscard]] Face read_face(const FaceSource& source, const Model& model);

}  // namespace stymo
