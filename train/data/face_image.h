#pragma once

#include <optional>
#include <string>

#include "core/io/image.h"
#include "core/tensor.h"
#include "train/data/folder_scan.h"

namespace stymo {

/// A file that cannot be used, and the reason.
struct BrokenFile {
    std::string file;
    std::string reason;
};

/// The image and the head mask of one face as they are stored.
struct FaceImage {
    Tensor image;  ///< (height, width, 3) in [0, 1]
    Tensor
        mask;  ///< (height, width, 1) in [0, 1], of a size of its own; undefined if there is none
    std::optional<BrokenFile>
        broken;  ///< the file that could not be read; image and mask are undefined then
};

/// Decodes the files of a face. The mask is the head mask, else made from the parsing, else from
/// the parts. Does not throw for unreadable files.
[[nodiscard]] FaceImage read_face_image(const FaceFiles& files,
                                        std::int64_t most_pixels = usual_most_pixels);

/// Whether the parsing or the parts tell the face from hair and ears.
[[nodiscard]] bool tells_face_region(const FaceFiles& files);
/// The face without hair and ears as 0 or 1, (height, width, 1) of the size it is stored in: of the
/// parsing, else of the parts. Throws FileError for a file that cannot be read, ValueError if there
/// is neither.
[[nodiscard]] Tensor read_face_region(const FaceFiles& files);

}  // namespace stymo
