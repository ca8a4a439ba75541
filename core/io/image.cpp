#include "core/io/image.h"

#include <OpenImageIO/imageio.h>
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/io/image_bytes.h"
#include "core/io/image_color.h"
#include "core/io/image_orientation.h"
#include "core/io/jpeg.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view png_signature = "\x89PNG\r\n\x1a\n";
/// Larger images are rejected if they have more pixels for each byte of the file than the formats
/// can store. Otherwise a false header would cause a huge allocation before missing pixels are
/// noticed.
constexpr std::int64_t trusted_pixels = std::int64_t{1} << 24;
constexpr std::int64_t most_pixels_of_a_byte = 10000;
/// The longest side of a JPEG file. OpenImageIO reads hundreds of rows at a time, even of an image
/// that has a single one.
constexpr std::int64_t longest_side = 65535;

[[noreturn]] void refuse(const fs::path& path, std::string_view reason) {
    // OpenImageIO's messages may have several lines; the first one is the cause.
    fail<FileError>(path.string(), ": cannot be read (", reason.substr(0, reason.find('\n')), ")");
}

/// Throws if the header's size is not plausible for a file of this length.
void require_plausible_size(const fs::path& path, std::int64_t width, std::int64_t height,
                            std::size_t bytes, std::int64_t most_pixels) {
    if (std::max(width, height) > longest_side) {
        fail<FileError>(path.string(), ": cannot be read (image too large: ", width, " x ", height,
                        " pixels; a side may have at most ", longest_side, ")");
    }
    const std::int64_t pixels = width * height;
    if (pixels > most_pixels) {
        fail<FileError>(path.string(), ": cannot be read (image too large: ", width, " x ", height,
                        " pixels; at most ", most_pixels, " are allowed, see --max-pixels)");
    }
    if (pixels > trusted_pixels &&
        pixels / most_pixels_of_a_byte > static_cast<std::int64_t>(bytes))
        fail<FileError>(path.string(), ": cannot be read (its ", bytes, " bytes claim ", width,
                        " x ", height, " pixels)");
}

/// What is wrong with the chunks of a PNG file. OpenImageIO lets libpng print to stderr when it
/// meets such a file.
std::optional<std::string> png_damage(std::string_view bytes) {
    const auto number = [&](std::size_t at) {
        const auto byte = [&](std::size_t i) {
            return static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + i]));
        };
        return (byte(0) << 24) | (byte(1) << 16) | (byte(2) << 8) | byte(3);
    };
    std::size_t at = png_signature.size();
    while (bytes.size() - at >= 12) {
        const std::size_t length = number(at);
        if (bytes.size() - at - 12 < length) {
            break;
        }
        // A chunk is its length, type, data, and the checksum of the latter two.
        const std::string_view checked = bytes.substr(at + 4, length + 4);
        const auto* data = reinterpret_cast<const Bytef*>(checked.data());
        if (crc32(0, data, static_cast<uInt>(checked.size())) != number(at + 8 + length)) {
            return "damaged image";
        }
        if (checked.starts_with("IEND")) {
            return std::nullopt;
        }
        at += length + 12;
    }
    return "truncated image";
}

/// Bytes of a file whose header is that of an image.
std::string read_image_bytes(const fs::path& path) {
    std::string bytes = read_file(path);
    if (bytes.empty()) fail<FileError>(path.string(), ": not an image (zero bytes)");
    if (bytes.starts_with(png_signature)) {
        if (const auto damage = png_damage(bytes)) {
            refuse(path, *damage);
        }
    }
    return bytes;
}

struct Pixels {
    int height = 0;
    int width = 0;
    int channels = 0;
    int alpha_channel = -1;
    bool alpha_multiplied = false;
    std::vector<float> values;
    std::vector<float> inks{};  ///< cyan, magenta, yellow, black of each pixel, or empty
    ColorTags tags{};
};

/// Cameras write the number 2, or "uncalibrated" with DCF's name of Adobe RGB, R03
/// (DCF 2.0, 3.3.5), as an EXIF entry of four characters, whose length stands before it.
bool is_adobe_rgb(int exif_color_space, std::string_view bytes) {
    using namespace std::string_view_literals;
    constexpr int adobe = 2, uncalibrated = 0xffff;
    const std::string_view beginning = bytes.substr(0, 1 << 16);
    return exif_color_space == adobe ||
           (exif_color_space == uncalibrated &&
            (beginning.find("\x04\0\0\0R03\0"sv) != std::string_view::npos ||
             beginning.find("\0\0\0\x04R03\0"sv) != std::string_view::npos));
}

/// The colours' meaning. Files of floats hold light, if they hold colours.
ColorTags tags_of(const OIIO::ImageInput& input, std::string_view bytes) {
    const OIIO::ImageSpec& spec = input.spec();
    std::string profile;
    if (const OIIO::ParamValue* icc = spec.find_attribute("ICCProfile"))
        profile.assign(static_cast<const char*>(icc->data()),
                       static_cast<std::size_t>(icc->datasize()));
    const std::string_view format = input.format_name();
    const bool has_colors = spec.channelindex("R") >= 0 || spec.channelindex("Y") >= 0;
    if ((format == "openexr" || format == "hdr") && has_colors) {
        ColorTags tags;
        tags.gamma = 1.0;
        if (const OIIO::ParamValue* xy = spec.find_attribute("chromaticities");
            xy != nullptr && xy->type().basevalues() == 8 &&
            xy->type().basetype == OIIO::TypeDesc::FLOAT) {
            std::array<double, 8>& primaries = tags.primaries.emplace();
            std::copy_n(static_cast<const float*>(xy->data()), 8, primaries.begin());
        }
        return tags;
    }
    if (profile.empty() && is_adobe_rgb(spec.get_int_attribute("Exif:ColorSpace"), bytes))
        return adobe_rgb();
    return color_tags(bytes, std::move(profile));
}

/// The inks of an image that OpenImageIO has turned into colours without its profile.
std::vector<float> inks_of(const fs::path& path, std::string_view bytes,
                           const OIIO::ImageInput& input) {
    std::vector<float> inks;
    if (input.format_name() == std::string_view("jpeg")) {
        for (const std::uint8_t ink : jpeg_inks(bytes))
            inks.push_back(static_cast<float>(ink) / 255.0F);
    } else if (input.format_name() == std::string_view("tiff")) {
        OIIO::ImageSpec raw;
        raw.attribute("oiio:RawColor", 1);
        const auto again = OIIO::ImageInput::open(path.string(), &raw);
        constexpr int ink_count = 4;
        if (!again || again->spec().nchannels < ink_count) return {};
        inks.resize(ink_count * again->spec().image_pixels());
        if (!again->read_image(0, 0, 0, ink_count, OIIO::TypeFloat, inks.data())) inks.clear();
    }
    const OIIO::ImageSpec& spec = input.spec();
    if (inks.size() != 4 * spec.image_pixels()) inks.clear();
    return inks;
}

/// Whether the profile's header names the space of inks.
bool is_for_inks(std::string_view profile) {
    constexpr std::size_t place_of_space = 16;
    return profile.substr(std::min(place_of_space, profile.size()), 4) == "CMYK";
}

/// Whether the bytes begin as those of a format that is read, so that a file of which nothing can
/// be decoded is a damaged image.
bool begins_as_image(std::string_view bytes) {
    constexpr std::size_t place_of_kind = 8, place_of_box = 4;
    const auto has = [&](std::size_t at, std::string_view text) {
        return bytes.substr(std::min(at, bytes.size())).starts_with(text);
    };
    using std::string_view_literals::operator""sv;
    return (has(0, "RIFF") && has(place_of_kind, "WEBP")) || has(0, "GIF8") || has(0, "II*\0"sv) ||
           has(0, "MM\0*"sv) || has(0, "\xFF\xD8\xFF") || has(0, "\x89PNG") ||
           has(place_of_box, "ftypavif") || has(place_of_box, "ftypheic") ||
           has(0, "\0\0\0\x0CjP  "sv);
}

/// Throws FileError for what is no file, as a pipe, which can be read only once.
std::string bytes_of_image(const fs::path& path) {
    std::error_code error;
    if (fs::exists(path, error) && !fs::is_directory(path, error) &&
        !fs::is_regular_file(path, error))
        fail<FileError>(path.string(), ": is no file; write the image into one");
    return read_image_bytes(path);
}

Pixels read_pixels(const fs::path& path, std::int64_t most_pixels) {
    const std::string bytes = bytes_of_image(path);
    OIIO::ImageSpec hints;
    // Multiplying here ignores the file's gamma tag.
    hints.attribute("oiio:UnassociatedAlpha", 1);
    const auto input = OIIO::ImageInput::open(path.string(), &hints);
    if (!input) {
        static_cast<void>(OIIO::geterror());
        fail<FileError>(path.string(), begins_as_image(bytes) ? ": damaged image, or one of a kind "
                                                                "that cannot be read"
                                                              : ": not an image");
    }
    const OIIO::ImageSpec& spec = input->spec();
    if (spec.deep || spec.depth > 1 || spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0)
        refuse(path, "not a flat image");
    // The TIFF reader's first image of a raw photo that LibRaw does not know.
    if ((spec.get_int_attribute("tiff:subfiletype") & 1) != 0)
        fail<FileError>(path.string(), ": only its preview of ", spec.width, " x ", spec.height,
                        " pixels can be read; convert the raw photo to JPEG or TIFF");
    require_plausible_size(path, spec.width, spec.height, bytes.size(), most_pixels);
    Pixels pixels{
        spec.height, spec.width, std::min(spec.nchannels, 4), spec.alpha_channel, false, {},
        {},          {}};
    pixels.alpha_multiplied = spec.get_int_attribute("oiio:UnassociatedAlpha", 0) == 0;
    const int orientation = input->format_name() == std::string_view("webp")
                                ? webp_orientation(bytes)
                                : spec.get_int_attribute("Orientation", 1);
    pixels.values.resize(static_cast<std::size_t>(pixels.height) *
                         static_cast<std::size_t>(pixels.width) *
                         static_cast<std::size_t>(pixels.channels));
    const bool complete =
        input->read_image(0, 0, 0, pixels.channels, OIIO::TypeFloat, pixels.values.data());
    // OpenImageIO reads a truncated JPEG successfully and only leaves a warning.
    const std::string message = input->geterror();
    const bool is_jpeg = input->format_name() == std::string_view("jpeg");
    if (!complete || (!message.empty() && !(is_jpeg && !jpeg_lost_pixels(bytes))))
        refuse(path, message.empty() ? "damaged image" : message);
    pixels.tags = tags_of(*input, bytes);
    if (is_for_inks(pixels.tags.profile)) pixels.inks = inks_of(path, bytes, *input);
    if (orientation > 1 && orientation <= 8) {
        pixels.values = turned_upright(pixels.values, pixels.height, pixels.width, pixels.channels,
                                       orientation);
        if (!pixels.inks.empty())
            pixels.inks = turned_upright(pixels.inks, pixels.height, pixels.width, 4, orientation);
        constexpr int first_on_its_side = 5;
        if (orientation >= first_on_its_side) std::swap(pixels.width, pixels.height);
    }
    return pixels;
}

/// Red, green and blue as the file has them.
Tensor colors_of(const Pixels& pixels) {
    Tensor result({pixels.height, pixels.width, 3});
    const auto target = result.mutable_values<float>();
    const auto channels = static_cast<std::size_t>(pixels.channels);
    const bool colour = pixels.channels >= 3;
    for (std::size_t i = 0; i < target.size(); ++i)
        target[i] = pixels.values[i / 3 * channels + (colour ? i % 3 : 0)];
    return result;
}

/// Multiplies by alpha and clips to [0, 1].
Tensor over_black(Tensor colors, const Pixels& pixels) {
    const auto channels = static_cast<std::size_t>(pixels.channels);
    const bool multiply = pixels.alpha_channel >= 0 && pixels.alpha_channel < pixels.channels &&
                          !pixels.alpha_multiplied;
    const auto values = colors.mutable_values<float>();
    for (std::size_t i = 0; i < values.size(); ++i) {
        const float alpha =
            multiply
                ? pixels.values[i / 3 * channels + static_cast<std::size_t>(pixels.alpha_channel)]
                : 1.0F;
        const float value = values[i] * alpha;
        // The order of the comparisons makes NaN end in 0.
        values[i] = value > 0.0F ? std::min(value, 1.0F) : 0.0F;
    }
    return colors;
}

std::string encoded(const std::string& name, const Tensor& image) {
    return encoded_image(
        {.name = name,
         .height = image.shape(0),
         .width = image.shape(1),
         .channels = image.shape(2),
         .attributes = {{"Compression", "jpeg:95"}, {"jpeg:subsampling", "4:4:4"}}},
        image_bytes(image).data());
}

}  // namespace

Tensor read_image(const fs::path& path, std::int64_t most_pixels, std::string* doubt) {
    const Pixels pixels = read_pixels(path, most_pixels);
    Tensor colors = colors_of(pixels);
    const std::string unused =
        convert_to_srgb(colors.mutable_values<float>(), pixels.inks, pixels.tags);
    if (doubt != nullptr)
        *doubt = unused.empty() ? unused : unused + "; its colours are taken as sRGB";
    return over_black(std::move(colors), pixels);
}

Tensor read_mask(const fs::path& path, std::int64_t most_pixels) {
    const Pixels pixels = read_pixels(path, most_pixels);
    const Tensor colours = over_black(colors_of(pixels), pixels);
    Tensor result({colours.shape(0), colours.shape(1), 1});
    const auto source = colours.values<float>();
    const auto target = result.mutable_values<float>();
    for (std::size_t i = 0; i < target.size(); ++i) {
        // ITU-R BT.601 weights, in double so that grey comes back exactly.
        target[i] = static_cast<float>(0.299 * source[3 * i] + 0.587 * source[3 * i + 1] +
                                       0.114 * source[3 * i + 2]);
    }
    return result;
}

Tensor read_class_map(const fs::path& path) {
    // OpenImageIO and OpenCV replace palette indices by their colours; libpng's own interface can
    // leave them.
    const std::string bytes = read_image_bytes(path);
    png_image image;
    std::memset(&image, 0, sizeof image);
    image.version = PNG_IMAGE_VERSION;
    if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) == 0)
        fail<FileError>(path.string(), ": not a PNG image");
    const bool palette = (image.format & PNG_FORMAT_FLAG_COLORMAP) != 0;
    const png_uint_32 more_than_indices =
        PNG_FORMAT_FLAG_COLOR | PNG_FORMAT_FLAG_LINEAR | PNG_FORMAT_FLAG_ALPHA;
    const std::int64_t width = image.width, height = image.height;
    if (!palette && (image.format & more_than_indices) != 0) {
        png_image_free(&image);
        fail<FileError>(path.string(), ": not a class map (needs an 8-bit palette or grey PNG)");
    }
    try {
        require_plausible_size(path, width, height, bytes.size(), usual_most_pixels);
    } catch (const FileError&) {
        png_image_free(&image);
        throw;
    }
    image.format = PNG_FORMAT_RGBA_COLORMAP;
    std::vector<png_byte> indices(PNG_IMAGE_SIZE(image));
    std::vector<png_byte> colours(PNG_IMAGE_COLORMAP_SIZE(image));
    // Frees the image, also on failure.
    if (png_image_finish_read(&image, nullptr, indices.data(), 0, colours.data()) == 0)
        refuse(path, image.message);
    Tensor result({image.height, image.width, 1});
    std::copy(indices.begin(), indices.end(), result.mutable_values<float>().begin());
    return result;
}

void write_image(const fs::path& path, const Tensor& image, Durability durability) {
    require_image(image, "write_image", true);
    const std::string extension = path.extension().string();
    if (extension != ".png" && extension != ".jpg" && extension != ".jpeg")
        fail<FileError>(path.string(), ": cannot be written (images end in .png or .jpg)");
    if (image.shape(2) == 4 && extension != ".png")
        fail<FileError>(path.string(), ": has no transparency; name a .png file");
    write_file(path, encoded(path.filename(), image), durability);
}

std::string png_bytes(const Tensor& image) {
    require_image(image, "png_bytes", true);
    return encoded("memory.png", image);
}

void write_exr(const fs::path& path, const Tensor& image) {
    require_image(image, "write_exr");
    if (path.extension() != ".exr")
        fail<FileError>(path.string(), ": cannot be written (float images end in .exr)");
    const Tensor values = image.to(DType::float32);
    const ImageEncoding encoding{.name = path.filename(),
                                 .height = image.shape(0),
                                 .width = image.shape(1),
                                 .channels = image.shape(2),
                                 .floats = true,
                                 .attributes = {{"compression", "zip"}}};
    write_file(path, encoded_image(encoding, values.values<float>().data()), Durability::none);
}

}  // namespace stymo
