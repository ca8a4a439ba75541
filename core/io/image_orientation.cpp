#include "core/io/image_orientation.h"

#include <OpenImageIO/imageio.h>
#include <OpenImageIO/tiffutils.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace stymo {

int webp_orientation(std::string_view bytes) {
    using namespace std::string_view_literals;
    constexpr std::size_t first_chunk = 12, header = 8;
    constexpr std::string_view prefix = "Exif\0\0"sv;
    for (std::size_t at = first_chunk; at < bytes.size() && bytes.size() - at >= header;) {
        std::uint32_t size = 0;
        for (std::size_t i = 4; i-- > 0;)
            size = size << 8 | static_cast<unsigned char>(bytes[at + 4 + i]);
        std::string_view data = bytes.substr(at + header, size);
        if (bytes.substr(at, 4) == "EXIF") {
            if (data.starts_with(prefix)) data.remove_prefix(prefix.size());
            OIIO::ImageSpec spec;
            const bool read = OIIO::decode_exif(OIIO::string_view(data.data(), data.size()), spec);
            return read ? spec.get_int_attribute("Orientation", 1) : 1;
        }
        at += header + std::size_t{size} + size % 2;
    }
    return 1;
}

std::vector<float> turned_upright(const std::vector<float>& values, int height, int width,
                                  int channels, int orientation) {
    const bool on_its_side = orientation >= 5;
    const bool rows_back =
        orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
    const bool columns_back =
        orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
    std::vector<float> result(values.size());
    auto target = result.begin();
    for (int row = 0; row < (on_its_side ? width : height); ++row)
        for (int column = 0; column < (on_its_side ? height : width); ++column) {
            int from_row = row, from_column = column;
            if (on_its_side) std::swap(from_row, from_column);
            if (rows_back) from_row = height - 1 - from_row;
            if (columns_back) from_column = width - 1 - from_column;
            const std::ptrdiff_t pixel = std::ptrdiff_t{from_row} * width + from_column;
            target = std::copy_n(values.begin() + pixel * channels, channels, target);
        }
    return result;
}

}  // namespace stymo
