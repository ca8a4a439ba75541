#pragma once

#include <filesystem>
#include <mutex>
#include <optional>

#include "core/tensor.h"
#include "fit/photo/face_parser.h"
#include "train/face_picture.h"

namespace stymo {

/// Where the face without hair and ears is on a photo: as the folder's parsing or annotated parts say, else as a face parser
/// finds it.
class FaceRegion {
public:
    /// `parser`: an ONNX file, or empty for none. Throws what FaceParser throws.
    explicit FaceRegion(const std::filesystem::path& parser = {});

    /// Whether `mask` can tell.
    [[nodiscard]] bool tells(const FaceFiles& files) const { return parser_ || tells_face_region(files); }
    /// (side, side, 1) in [0, 1], of the photo's central square. Safe from several threads. Throws FileError for a file that
    /// cannot be read, or if nothing tells the region.
    [[nodiscard]] Tensor mask(const FaceFiles& files, std::int64_t side);

private:
    std::optional<FaceParser> parser_;
    std::mutex parsing_;
};

}  // namespace stymo
