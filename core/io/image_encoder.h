#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
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
    double frames_per_second = 0.0;                   ///< of an animation
};

/// The bytes of an image file. They are encoded in memory, because OpenImageIO does not notice
/// when the disk refuses a part of a file; `write_file` does. Throws FileError if the image
/// cannot be encoded.
[[nodiscard]] std::string encoded_image(const ImageEncoding& encoding, const void* pixels);
/// The bytes of an animation of `count` frames. The pixels of a frame must stay valid until those
/// of the next one are asked for.
[[nodiscard]] std::string encoded_frames(
    const ImageEncoding& encoding, std::size_t count,
    const std::function<const void*(std::size_t frame)>& pixels);

}  // namespace stymo
