#include "core/io/image_encoder.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

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
    if (encoding.frames_per_second > 0.0) {
        // GIF counts delays in hundredths of a second, and most viewers slow down delays below two
        // of them.
        const double delay = std::min(100.0 / encoding.frames_per_second, 60000.0);
        const std::array<int, 2> rate{100, std::max(2, static_cast<int>(std::lround(delay)))};
        spec.attribute("FramesPerSecond", OIIO::TypeRational, rate.data());
        spec.attribute("oiio:Movie", 1);
    }
    return spec;
}

}  // namespace

std::string encoded_image(const ImageEncoding& encoding, const void* pixels) {
    return encoded_frames(encoding, 1, [pixels](std::size_t) { return pixels; });
}

std::string encoded_frames(const ImageEncoding& encoding, std::size_t count,
                           const std::function<const void*(std::size_t frame)>& pixels) {
    OIIO::Filesystem::IOVecOutput memory;
    const auto output = OIIO::ImageOutput::create(encoding.name, &memory);
    const std::vector<OIIO::ImageSpec> specs(count, spec_of(encoding));
    bool encoded = output && output->open(encoding.name, static_cast<int>(count), specs.data());
    for (std::size_t i = 0; encoded && i < count; ++i) {
        const OIIO::ImageSpec& spec = specs[i];
        encoded =
            (i == 0 || output->open(encoding.name, spec, OIIO::ImageOutput::AppendSubimage)) &&
            output->write_image(spec.format, pixels(i));
    }
    if (!encoded || !output->close())
        fail<FileError>(encoding.name, ": cannot be encoded (",
                        output ? output->geterror() : OIIO::geterror(), ")");
    return {memory.buffer().begin(), memory.buffer().end()};
}

}  // namespace stymo
