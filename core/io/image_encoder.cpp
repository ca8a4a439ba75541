#include "core/io/image_encoder.h"

#include <OpenImageIO/filesystem.h>

#include <vector>

#include "core/error.h"

namespace stymo {

std::string encoded_image(const std::string& name, const OIIO::ImageSpec& spec,
                          const void* pixels) {
    return encoded_frames(name, spec, 1, [pixels](std::size_t) { return pixels; });
}

std::string encoded_frames(const std::string& name, const OIIO::ImageSpec& spec, std::size_t count,
                           const std::function<const void*(std::size_t frame)>& pixels) {
    OIIO::Filesystem::IOVecOutput memory;
    const auto output = OIIO::ImageOutput::create(name, &memory);
    const std::vector<OIIO::ImageSpec> specs(count, spec);
    bool encoded =
        output && (count == 1 ? output->open(name, spec)
                              : output->open(name, static_cast<int>(count), specs.data()));
    for (std::size_t i = 0; encoded && i < count; ++i) {
        encoded = (i == 0 || output->open(name, spec, OIIO::ImageOutput::AppendSubimage)) &&
                  output->write_image(spec.format, pixels(i));
    }
    if (!encoded || !output->close())
        fail<FileError>(name, ": cannot be encoded (",
                        output ? output->geterror() : OIIO::geterror(), ")");
    return {memory.buffer().begin(), memory.buffer().end()};
}

}  // namespace stymo
