#include "core/io/mask_file.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace stymo {

MaskFile read_mask_file(const std::filesystem::path& path, std::int64_t most_pixels) {
    constexpr float largest_one = 1.01F / 255.0F;
    MaskFile file{read_mask(path, most_pixels)};
    const auto values = file.mask.values<float>();
    const float one = std::ranges::max(values);
    file.was_scaled =
        one > 0.0F && one < largest_one &&
        std::ranges::all_of(values, [one](float value) { return value == 0.0F || value == one; });
    if (!file.was_scaled) return file;
    for (float& value : file.mask.mutable_values<float>()) value = value > 0.0F ? 1.0F : 0.0F;
    return file;
}

void require_covering(const Tensor& mask, const std::string& prefix) {
    // Maps of class indices, and 0 and 1 as a JPEG file, would black the photo out, too.
    constexpr float nearly_black = 0.1F;
    const float brightest = std::ranges::max(mask.values<float>());
    if (brightest < nearly_black)
        fail<FileError>(prefix, "covers nothing (",
                        brightest > 0.0F
                            ? "its brightest pixel has " +
                                  std::to_string(std::lround(255.0F * brightest)) + " of 255"
                            : std::string("every pixel is 0"),
                        "); give a mask that is white on the head, or none");
}

}  // namespace stymo
