#pragma once

#include <optional>
#include <string>

#include "core/io/image.h"
#include "core/tensor.h"
#include "train/data/folder_scan.h"

namespace stymo {

/// The image and the head mask of one face at their stored sizes.
struct FaceImage {
    Tensor image{};  ///< (height, width, 3) in [0, 1]
    /// (height, width, 1) in [0, 1]; its size may differ from the image's. Undefined if there is
    /// none.
    Tensor mask{};
    Tensor known{};            ///< the same, see nn/known_pixels.h; undefined: all pixels are known
    bool scaled_mask = false;  ///< MaskFile::was_scaled of any of its masks
    std::string doubt{};       ///< why the image's colours could not be converted to sRGB, or empty
    /// The file that could not be read; image and mask are then undefined.
    std::optional<BrokenFile> broken{};
};

/// The known pixels (height, width, 1) of a photo whose unknown ones are white in a mask: those
/// whose grey is below a tenth. Undefined if there are none.
[[nodiscard]] Tensor known_outside(Tensor unknown);

/// Decodes the files of a face. The mask is read from the head mask, else made from the parsing,
/// else from the mask parts; one that covers nothing counts as unreadable. Does not throw for
/// unreadable files.
[[nodiscard]] FaceImage read_face_image(const FaceFiles& files,
                                        std::int64_t most_pixels = usual_most_pixels);

/// Masks are often smaller than their images, but must have the same aspect ratio, up to the
/// rounding of one pixel. Throws FileError, without a file's name, if this one has not.
void require_same_frame(const Tensor& mask, const Tensor& image);

/// Whether there is a parsing or there are mask parts, from which `read_face_region` can be made.
[[nodiscard]] bool tells_face_region(const FaceFiles& files);
/// The face without hair and ears, (height, width, 1) of 0 or 1 at the stored size: from the
/// parsing, else from the mask parts. Throws FileError for a file that cannot be read, ValueError
/// if there is neither.
[[nodiscard]] Tensor read_face_region(const FaceFiles& files);

}  // namespace stymo
