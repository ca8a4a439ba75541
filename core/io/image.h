#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/io/file.h"
#include "core/tensor.h"

namespace stymo {

/// Default limit for the pixels of an image file.
inline constexpr std::int64_t usual_most_pixels = std::int64_t{1} << 28;

/// Reads any image as float32 (height, width, 3), sRGB in [0, 1], turned upright by its EXIF
/// orientation. Colours are converted to sRGB by the file's ICC profile or colour tags
/// (image_color.h), and light in an EXR file by sRGB's curve. Grey images are repeated in all
/// channels, alpha is composited over black, integers are scaled and floats clipped. `doubt`
/// becomes why the profile or the tags cannot be used, or empty. Throws FileError with a short
/// reason ("not an image (zero bytes)") if the file is not a readable image or has lost pixels,
/// and, before pixels are read, if it has more than `most_pixels`.
[[nodiscard]] Tensor read_image(const std::filesystem::path& path,
                                std::int64_t most_pixels = usual_most_pixels,
                                std::string* doubt = nullptr);
/// Reads one channel as float32 (height, width, 1) in [0, 1]: a mask, whose values are taken as
/// they are. A colour image becomes its luminance.
[[nodiscard]] Tensor read_mask(const std::filesystem::path& path,
                               std::int64_t most_pixels = usual_most_pixels);
/// Reads the raw indices (palette or grey, at most 8 bits) of a class map, a PNG file, as float32
/// (height, width, 1), values 0..255.
[[nodiscard]] Tensor read_class_map(const std::filesystem::path& path);

/// Writes an image (height, width, 1 or 3; 4 in a .png: RGB that are not multiplied by alpha, and
/// alpha). Values are clipped to [0, 1] and rounded to 8 bits. The extension selects the format
/// (png, jpg). The file is written completely or not at all. Throws
/// ShapeError for other shapes, FileError if the file cannot be written.
void write_image(const std::filesystem::path& path, const Tensor& image,
                 Durability durability = Durability::none);
/// The bytes that write_image writes to a .png file.
[[nodiscard]] std::string png_bytes(const Tensor& image);
/// Writes 32-bit float channels to an .exr file without clipping. A single channel is named "Y",
/// three are named "R,G,B". Throws like write_image.
void write_exr(const std::filesystem::path& path, const Tensor& image);
/// Writes an animation: .gif or .webp (repeated endlessly) or .mp4. All frames are (height, width,
/// 3) in [0, 1]. Throws ValueError without frames and for a rate that is not positive and finite,
/// ShapeError for frames of other or different shapes, and FileError if writing fails.
void write_animation(const std::filesystem::path& path, const std::vector<Tensor>& frames,
                     double frames_per_second);
/// Whether `write_animation` writes files of this name.
[[nodiscard]] bool is_animation(const std::filesystem::path& path);

/// Antialiased resampling of (height, width, channels) to another size; values may overshoot
/// slightly.
[[nodiscard]] Tensor resize_image(const Tensor& image, int height, int width);
/// The rows top..top+height-1 and columns left..left+width-1 of (height, width, channels). Throws
/// ShapeError if they are outside the image.
[[nodiscard]] Tensor image_part(const Tensor& image, std::int64_t top, std::int64_t left,
                                std::int64_t height, std::int64_t width);
/// The largest square in the middle of (height, width, channels).
[[nodiscard]] Tensor central_square(const Tensor& image);
/// Images of the same size side by side, `columns` in a row. Missing images of the last row are
/// black. Throws ValueError without images or columns, ShapeError for different sizes.
[[nodiscard]] Tensor tile_images(const std::vector<Tensor>& images, int columns);
/// Turned clockwise by this number of quarter turns; a negative one turns the other way.
[[nodiscard]] Tensor turned_image(const Tensor& image, int quarter_turns);
/// Swaps left and right.
[[nodiscard]] Tensor mirror_image(const Tensor& image);

}  // namespace stymo
