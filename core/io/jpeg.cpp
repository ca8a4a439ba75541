#include "core/io/jpeg.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <vector>

#include "core/error.h"
#include "core/io/image_bytes.h"
#include "core/io/image_encoder.h"
#include "core/io/jpeg_damage.h"

namespace stymo {

namespace {

constexpr const char* jpeg_name = "memory.jpg";  ///< tells OpenImageIO the format

[[noreturn]] void refuse(const std::string& reason) {
    fail<FileError>("not a JPEG image (", reason.substr(0, reason.find('\n')), ")");
}

}  // namespace

std::string jpeg_bytes(const Tensor& image, int quality) {
    require_image(image, "jpeg_bytes");
    const std::string compression = "jpeg:" + std::to_string(std::clamp(quality, 1, 100));
    return encoded_image({.name = jpeg_name,
                          .height = image.shape(0),
                          .width = image.shape(1),
                          .channels = image.shape(2),
                          .attributes = {{"Compression", compression}}},
                         image_bytes(image).data());
}

Tensor image_from_jpeg(std::string_view bytes, std::int64_t most_pixels) {
    // OpenImageIO would try its readers of other formats.
    if (!bytes.starts_with("\xff\xd8\xff")) refuse("another beginning");
    OIIO::Filesystem::IOMemReader memory(const_cast<char*>(bytes.data()), bytes.size());
    const auto input = OIIO::ImageInput::open(jpeg_name, nullptr, &memory);
    if (!input) refuse(OIIO::geterror());
    const OIIO::ImageSpec& spec = input->spec();
    constexpr int most_channels = 4;
    if (std::string_view(input->format_name()) != "jpeg" || spec.depth > 1 || spec.deep ||
        spec.nchannels < 1 || spec.nchannels > most_channels)
        refuse("another format");
    if (std::int64_t{spec.width} * spec.height > most_pixels)
        refuse(std::to_string(spec.width) + " x " + std::to_string(spec.height) +
               " pixels are too many");
    const auto pixels =
        static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(spec.height);
    const auto channels = static_cast<std::size_t>(spec.nchannels);
    std::vector<float> values(pixels * channels);
    const bool complete =
        input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeFloat, values.data());
    if (const std::string message = input->geterror();
        !complete || (!message.empty() && jpeg_lost_pixels(bytes)))
        refuse(message.empty() ? "damaged" : message);
    Tensor image({spec.height, spec.width, 3});
    const std::span<float> target = image.mutable_values<float>();
    for (std::size_t i = 0; i < pixels; ++i) {
        for (std::size_t channel = 0; channel < 3; ++channel)
            target[3 * i + channel] = values[channels * i + std::min(channel, channels - 1)];
    }
    return image;
}

}  // namespace stymo
