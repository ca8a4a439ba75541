#include <webp/encode.h>
#include <webp/mux.h>

#include <cmath>
#include <cstdint>
#include <memory>

#include "core/error.h"
#include "core/io/animation_bytes.h"
#include "core/io/image_bytes.h"

namespace stymo {
namespace {

[[noreturn]] void refuse(const char* reason) {
    fail<FileError>("the WebP cannot be encoded (", reason, ")");
}

struct Picture : WebPPicture {
    Picture() : WebPPicture() {
        if (WebPPictureInit(this) == 0) refuse("another version of libwebp");
        use_argb = 1;
    }
    ~Picture() { WebPPictureFree(this); }
    Picture(const Picture&) = delete;
    Picture& operator=(const Picture&) = delete;
};

struct Assembled : WebPData {
    Assembled() : WebPData() { WebPDataInit(this); }
    ~Assembled() { WebPDataClear(this); }
    Assembled(const Assembled&) = delete;
    Assembled& operator=(const Assembled&) = delete;
};

WebPConfig configuration() {
    constexpr float quality = 90.0F;
    WebPConfig config;
    if (WebPConfigPreset(&config, WEBP_PRESET_PICTURE, quality) == 0)
        refuse("another version of libwebp");
    // Colours at half the resolution leave a red edge grey.
    config.use_sharp_yuv = 1;
    return config;
}

}  // namespace

std::string webp_bytes(const std::vector<Tensor>& frames, double frames_per_second) {
    const auto height = static_cast<int>(frames[0].shape(0)),
               width = static_cast<int>(frames[0].shape(1));
    WebPAnimEncoderOptions options;
    if (WebPAnimEncoderOptionsInit(&options) == 0) refuse("another version of libwebp");
    const std::unique_ptr<WebPAnimEncoder, void (*)(WebPAnimEncoder*)> encoder(
        WebPAnimEncoderNew(width, height, &options), WebPAnimEncoderDelete);
    if (!encoder) refuse("too large");
    const WebPConfig config = configuration();
    const auto milliseconds = [&](std::size_t frame) {
        return static_cast<int>(
            std::lround(1000.0 * static_cast<double>(frame) / std::max(frames_per_second, 0.01)));
    };
    for (std::size_t i = 0; i < frames.size(); ++i) {
        Picture picture;
        picture.width = width;
        picture.height = height;
        const std::vector<std::uint8_t> bytes = image_bytes(frames[i]);
        if (WebPPictureImportRGB(&picture, bytes.data(), 3 * width) == 0 ||
            WebPAnimEncoderAdd(encoder.get(), &picture, milliseconds(i), &config) == 0)
            refuse(WebPAnimEncoderGetError(encoder.get()));
    }
    Assembled data;
    if (WebPAnimEncoderAdd(encoder.get(), nullptr, milliseconds(frames.size()), nullptr) == 0 ||
        WebPAnimEncoderAssemble(encoder.get(), &data) == 0)
        refuse(WebPAnimEncoderGetError(encoder.get()));
    return {reinterpret_cast<const char*>(data.bytes), data.size};
}

}  // namespace stymo
