#pragma once

#include <OpenImageIO/imageio.h>

#include <cstddef>
#include <functional>
#include <string>

namespace stymo {

/// The bytes of an image file. They are encoded in memory, because OpenImageIO does not notice
/// when the disk refuses a part of a file; `write_text_file` does. The extension of `name` selects
/// the format, `spec.format` is the type of the pixels. Throws FileError if it cannot be encoded.
[[nodiscard]] std::string encoded_image(const std::string& name, const OIIO::ImageSpec& spec,
                                        const void* pixels);
/// The same with `count` frames of one size. The pixels of a frame must stay valid until the next
/// one is asked for.
[[nodiscard]] std::string encoded_frames(
    const std::string& name, const OIIO::ImageSpec& spec, std::size_t count,
    const std::function<const void*(std::size_t frame)>& pixels);

}  // namespace stymo
