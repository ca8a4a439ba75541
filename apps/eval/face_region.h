#pragma once

#include <filesystem>
#include <mutex>
#include <optional>

#include "core/tensor.h"
#include "fit/photo/face_parser.h"
#include "train/data/face_image.h"

namespace stymo {

/// The mask of the face without hair and ears: from the folder's parsing maps or annotated parts,
/// else from a face parser.
class FaceRegion {
public:
    /// `parser`: an ONNX file, or empty for none. Throws what FaceParser throws.
    explicit FaceRegion(const std::filesystem::path& parser = {});

    /// Whether `mask` can determine the region.
    [[nodiscard]] bool tells(const FaceFiles& files) const {
        return parser_ || tells_face_region(files);
    }
    /// The mask (side, side, 1) in [0, 1] for the photo's central square. Thread-safe. Throws
    /// FileError for a file that cannot be read, or if there is neither a parsing map nor a parser.
    [[nodiscard]] Tensor mask(const FaceFiles& files, std::int64_t side);

private:
    std::optional<FaceParser> parser_;
    std::mutex parsing_;
};

}  // namespace stymo
