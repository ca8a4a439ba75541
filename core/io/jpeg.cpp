#include "core/io/jpeg.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <memory>

// The two headers of libjpeg, which do not include what they need.
#include <jerror.h>
#include <jpeglib.h>

#include "core/error.h"
#include "core/io/image_bytes.h"

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

namespace {

/// What libjpeg's messages say; `errors` is first, because libjpeg hands out its address.
struct Verdict {
    jpeg_error_mgr errors{};
    std::jmp_buf give_up{};
    bool lost = false;
    bool without_end = false;
};

[[noreturn]] void on_error(j_common_ptr info) {
    std::longjmp(reinterpret_cast<Verdict*>(info->err)->give_up, 1);
}

void on_message(j_common_ptr info, int level) {
    if (level >= 0) return;
    auto* verdict = reinterpret_cast<Verdict*>(info->err);
    constexpr int first_restart = 0xd0, last_restart = 0xd7;
    switch (info->err->msg_code) {
        case JWRN_JFIF_MAJOR:
        case JWRN_NOT_SEQUENTIAL:
        case JWRN_ADOBE_XFORM: return;
        case JWRN_JPEG_EOF: verdict->without_end = true; return;
        case JWRN_EXTRANEOUS_DATA: {
            // Before a restart marker they are pixels.
            const int marker = info->err->msg_parm.i[1];
            verdict->lost = verdict->lost || (marker >= first_restart && marker <= last_restart);
            return;
        }
        default: verdict->lost = true;
    }
}

/// Whether scans of a file without an end mark are missing.
bool lacks_scans(jpeg_decompress_struct& jpeg) {
    if (jpeg.progressive_mode == FALSE) return jpeg_has_multiple_scans(&jpeg) == TRUE;
    for (int component = 0; component < jpeg.num_components; ++component) {
        const int* missing_bits = jpeg.coef_bits[component];
        if (std::any_of(missing_bits, missing_bits + DCTSIZE2, [](int bits) { return bits != 0; }))
            return true;
    }
    return false;
}

/// Decodes all rows; appends them to `inks` if the image has inks. Owns nothing, because an error
/// jumps out of it.
void decode(jpeg_decompress_struct& jpeg, Verdict& verdict, std::string_view bytes,
            std::vector<std::uint8_t>* inks) {
    if (setjmp(verdict.give_up) != 0) {
        verdict.lost = true;
        return;
    }
    jpeg_create_decompress(&jpeg);
    jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
    jpeg_read_header(&jpeg, TRUE);
    const bool has_inks = jpeg.jpeg_color_space == JCS_CMYK || jpeg.jpeg_color_space == JCS_YCCK;
    if (inks != nullptr && !has_inks) return;
    if (has_inks) jpeg.out_color_space = JCS_CMYK;
    jpeg_start_decompress(&jpeg);
    const auto length = static_cast<JDIMENSION>(jpeg.output_components) * jpeg.output_width;
    JSAMPARRAY row =
        (*jpeg.mem->alloc_sarray)(reinterpret_cast<j_common_ptr>(&jpeg), JPOOL_IMAGE, length, 1);
    // Adobe's files have the inks inverted.
    const int flip = jpeg.saw_Adobe_marker == TRUE ? 0xff : 0;
    while (jpeg.output_scanline < jpeg.output_height) {
        jpeg_read_scanlines(&jpeg, row, 1);
        if (inks == nullptr) continue;
        for (JDIMENSION i = 0; i < length; ++i)
            inks->push_back(static_cast<std::uint8_t>(row[0][i] ^ flip));
    }
    if (verdict.without_end && lacks_scans(jpeg)) verdict.lost = true;
}

bool decodes_whole(std::string_view bytes, std::vector<std::uint8_t>* inks) {
    Verdict verdict;
    jpeg_decompress_struct jpeg{};
    jpeg.err = jpeg_std_error(&verdict.errors);
    verdict.errors.error_exit = on_error;
    verdict.errors.emit_message = on_message;
    const std::unique_ptr<jpeg_decompress_struct, void (*)(jpeg_decompress_struct*)> end(
        &jpeg, [](jpeg_decompress_struct* one) { jpeg_destroy_decompress(one); });
    decode(jpeg, verdict, bytes, inks);
    return !verdict.lost;
}

}  // namespace

bool jpeg_lost_pixels(std::string_view bytes) {
    return !decodes_whole(bytes, nullptr);
}

std::vector<std::uint8_t> jpeg_inks(std::string_view bytes) {
    std::vector<std::uint8_t> inks;
    if (!decodes_whole(bytes, &inks)) inks.clear();
    return inks;
}

}  // namespace stymo
