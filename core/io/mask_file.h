#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/io/image.h"
#include "core/tensor.h"

namespace stymo {

/// A mask as a user stores it.
struct MaskFile {
    Tensor mask;  ///< as read_mask reads it
    /// The file has the values 0 and 1 (numpy's habit) in place of 0 and 255 or 65535; they were
    /// scaled.
    bool was_scaled = false;
};

/// Throws what read_mask throws.
[[nodiscard]] MaskFile read_mask_file(const std::filesystem::path& path,
                                      std::int64_t most_pixels = usual_most_pixels);

/// What to say of masks that were scaled.
inline constexpr const char* scaled_mask_note = "values of 0 and 1, which are taken for 0 and 255";

/// Throws FileError, with `prefix` before the reason, for a mask that is 0 everywhere or nearly
/// black.
void require_covering(const Tensor& mask, const std::string& prefix = "");

}  // namespace stymo
