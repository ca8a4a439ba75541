#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace stymo {

/// How an image is written.
struct ImageEncoding {
    std::string name;  ///< its extension selects the format
    std::int64_t height = 0;
    std::int64_t width = 0;
    std::int64_t channels = 0;
    bool floats = false;                              ///< pixels are float32; else bytes in sRGB
    std::map<std::string, std::string> attributes{};  ///< of OpenImageIO's ImageSpec
};

/// The bytes of an image file. They are encoded in memory, because OpenImageIO does not notice
/// when the disk refuses a part of a file; `write_file` does. Throws FileError if the image
/// cannot be encoded.
[[nodiscard]] std::string encoded_image(const ImageEncoding& encoding, const void* pixels);

}  // namespace stymo
