#include <webp/encode.h>
#include <webp/mux.h>

#include <cmath>
#include <memory>
#include <string>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/film.h"
#include "core/io/image.h"
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

namespace {

namespace fs = std::filesystem;

void encode_mp4(const fs::path& path, const fs::path& temporary, const std::vector<Tensor>& frames,
                double frames_per_second) {
    FilmWriter writer(path, temporary, frames[0].shape(0), frames[0].shape(1), frames_per_second);
    for (const Tensor& frame : frames) writer.add(frame);
    writer.finish();
}

}  // namespace

bool is_animation(const fs::path& path) {
    const std::string extension = path.extension();
    return extension == ".gif" || extension == ".webp" || extension == ".mp4";
}

void write_animation(const fs::path& path, const std::vector<Tensor>& frames,
                     double frames_per_second) {
    if (frames.empty() || !(frames_per_second > 0.0) || !std::isfinite(frames_per_second)) {
        fail<ValueError>("[write_animation] needs frames and a positive rate; got ", frames.size(),
                         " and ", frames_per_second);
    }
    for (const Tensor& frame : frames) {
        require_image(frame, "write_animation");
        if (frame.shape(2) != 3 || !(frame.shape() == frames[0].shape())) {
            fail<ShapeError>("[write_animation] frames are (height, width, 3) of one size; got ",
                             frames[0].shape(), " and ", frame.shape());
        }
    }
    const std::string extension = path.extension();
    if (extension == ".gif" || extension == ".webp") {
        const auto encode = extension == ".gif" ? gif_bytes : webp_bytes;
        return write_file(path, encode(frames, frames_per_second), Durability::none);
    }
    if (!is_animation(path))
        fail<FileError>(path.string(),
                        ": cannot be written (animations end in .gif, .webp or .mp4)");
    const auto write = [&](const fs::path& temporary) {
        encode_mp4(path, temporary, frames, frames_per_second);
    };
    write_whole(path, write, Durability::none);
}

}  // namespace stymo
