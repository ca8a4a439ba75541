#include "core/io/image_bytes.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>

#include "core/error.h"

namespace stymo {
namespace {

OIIO::ImageSpec spec_of(const ImageEncoding& encoding) {
    OIIO::ImageSpec spec(static_cast<int>(encoding.width), static_cast<int>(encoding.height),
                         static_cast<int>(encoding.channels),
                         encoding.floats ? OIIO::TypeFloat : OIIO::TypeUInt8);
    // OpenCV reads zeros from a file whose only channel is "Z", as depths are usually called.
    if (encoding.floats && encoding.channels == 1) spec.channelnames = {"Y"};
    if (!encoding.floats) spec.attribute("oiio:ColorSpace", "sRGB");
    // Colours are written as they are, not divided by alpha.
    if (encoding.channels == 4) spec.attribute("oiio:UnassociatedAlpha", 1);
    for (const auto& [name, value] : encoding.attributes) spec.attribute(name, value);
    return spec;
}

}  // namespace

std::string encoded_image(const ImageEncoding& encoding, const void* pixels) {
    // libjpeg ends the process at larger sides.
    constexpr std::int64_t largest_jpeg = 65500;
    if (std::max(encoding.height, encoding.width) > largest_jpeg &&
        (encoding.name.ends_with("jpg") || encoding.name.ends_with("jpeg")))
        fail<FileError>(encoding.name, ": ", encoding.width, " x ", encoding.height,
                        " pixels are more than a JPEG file holds, ", largest_jpeg,
                        " along a side; write a .png file");
    OIIO::Filesystem::IOVecOutput memory;
    const auto output = OIIO::ImageOutput::create(encoding.name, &memory);
    const OIIO::ImageSpec spec = spec_of(encoding);
    if (!output || !output->open(encoding.name, spec) ||
        !output->write_image(spec.format, pixels) || !output->close())
        fail<FileError>(encoding.name, ": cannot be encoded (",
                        output ? output->geterror() : OIIO::geterror(), ")");
    return {memory.buffer().begin(), memory.buffer().end()};
}

}  // namespace stymo
