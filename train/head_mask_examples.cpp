#include "train/head_mask_examples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "core/error.h"
#include "core/io/image.h"
#include "core/io/mask_file.h"
#include "core/ops/elementwise.h"
#include "core/parallel.h"
#include "nn/pretrained/head_mask_network.h"
#include "train/data/face_image.h"
#include "train/data/folder_scan.h"

namespace stymo {
namespace {

namespace fs = std::filesystem;

constexpr int picture_side = HeadMaskNetwork::usual_side;
constexpr int photo_channels = 6;
constexpr int mask_channel = 3;
constexpr int known_channel = 4;
constexpr int person_channel = 5;

using Pixel = std::array<float, photo_channels>;

Tensor at_usual_side(const Tensor& image) {
    return clamp(resize_image(image, picture_side, picture_side), 0.0, 1.0).value();
}

std::uint8_t byte_of(float value) {
    return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(value, 0.0F, 1.0F)));
}

/// Writes the channels of an image beside each other, from channel `first` on.
void put(std::vector<std::uint8_t>& bytes, int channels, int first, const Tensor& image) {
    const auto values = image.values<float>();
    const auto own = static_cast<std::size_t>(image.shape(2));
    for (std::size_t i = 0; i < values.size(); ++i)
        bytes[i / own * static_cast<std::size_t>(channels) + static_cast<std::size_t>(first) +
              i % own] = byte_of(values[i]);
}

/// The bilinear sample of a picture; pixels beyond its border repeat the border.
template <int channels>
std::array<float, channels> sample(std::span<const std::uint8_t> bytes, const ImagePoint& point) {
    const double column = std::clamp(point[0] * picture_side - 0.5, 0.0, picture_side - 1.001),
                 row = std::clamp(point[1] * picture_side - 0.5, 0.0, picture_side - 1.001);
    const auto left = static_cast<std::size_t>(column), top = static_cast<std::size_t>(row);
    const auto right = static_cast<float>(column - static_cast<double>(left));
    const auto low = static_cast<float>(row - static_cast<double>(top));
    const std::uint8_t* corner = bytes.data() + (top * picture_side + left) * channels;
    const std::uint8_t* below = corner + std::size_t{picture_side} * channels;
    std::array<float, channels> values{};
    for (std::size_t c = 0; c < channels; ++c) {
        const float upper = corner[c] + right * (corner[c + channels] - corner[c]);
        const float lower = below[c] + right * (below[c + channels] - below[c]);
        values[c] = (upper + low * (lower - upper)) / 255.0F;
    }
    return values;
}

bool is_inside(const ImagePoint& point) {
    return std::ranges::all_of(point, [](double x) { return x >= 0.0 && x <= 1.0; });
}

/// Of the pixel with this index, row by row.
ImagePoint point_of(int pixel) {
    return {(pixel % picture_side + 0.5) / picture_side,
            (pixel / picture_side + 0.5) / picture_side};
}

void recolor(Pixel& pixel, const ColorChange& change) {
    std::ranges::copy(change({pixel[0], pixel[1], pixel[2]}), pixel.begin());
}

/// A part of a picture, or a colour if the picture is empty.
class Cloth {
public:
    Cloth(std::span<const std::uint8_t> picture, Rng& rng)
        : picture_(picture), placement_(180.0, 3.0, 0.4, rng) {
        for (float& value : color_) value = static_cast<float>(rng.uniform());
    }

    void paint(Pixel& pixel, const ImagePoint& point) const {
        std::ranges::copy(picture_.empty() ? color_ : sample<3>(picture_, placement_.source(point)),
                          pixel.begin());
    }

private:
    std::span<const std::uint8_t> picture_;
    ImagePlacement placement_;
    std::array<float, 3> color_{};
};

/// Glasses are head.
void put_on(const Glasses& glasses, const ImagePoint& point, Pixel& pixel) {
    const Glasses::Paint paint = glasses.paint(point);
    if (paint.opacity == 0.0F || (paint.temple && pixel[mask_channel] < 0.5F)) return;
    for (std::size_t c = 0; c < 3; ++c) pixel[c] += paint.opacity * (paint.color[c] - pixel[c]);
    pixel[mask_channel] = pixel[known_channel] = pixel[person_channel] = 1.0F;
}

/// A hat is not head. Hair beside it gives way to the background, or is not known.
void put_on(const Hat& hat, const Cloth& cloth, const ImagePoint& point, bool moves, Pixel& pixel) {
    switch (hat.part(point)) {
        case Hat::Part::hat:
            cloth.paint(pixel, point);
            pixel[mask_channel] = 0.0F;
            pixel[known_channel] = pixel[person_channel] = 1.0F;
            break;
        case Hat::Part::outside:
            if (!moves && pixel[mask_channel] > 0.0F) pixel[known_channel] = 0.0F;
            pixel[mask_channel] = pixel[person_channel] = 0.0F;
            break;
        case Hat::Part::shadow:
            for (std::size_t c = 0; c < 3; ++c) pixel[c] *= 0.6F;
            break;
        case Hat::Part::none: break;
    }
}

}  // namespace

struct HeadMaskExamples::Example {
    std::vector<Pixel> pixels;
};

HeadMaskExamples::HeadMaskExamples(const fs::path& folder) {
    // Else a folder of people would count as photos.
    if (!fs::is_directory(folder / "images"))
        fail<FileError>(folder.string(), ": has no folder images");
    const FolderScan scan = scan_folder(folder);
    left_out_ = scan.left_out;
    photos_.resize(scan.faces.size());
    parallel_for(std::ssize(photos_), 8, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
            photos_[i] = read_photo(folder, scan.faces[i]);
    });
    if (!fs::is_directory(folder / "backgrounds")) return;
    for (const fs::path& file : images_below(folder / "backgrounds").images) {
        Picture picture{std::vector<std::uint8_t>(std::size_t{picture_side} * picture_side * 3)};
        put(picture.bytes, 3, 0, at_usual_side(central_square(read_image(file))));
        backgrounds_.push_back(std::move(picture));
    }
}

HeadMaskExamples::Picture HeadMaskExamples::read_photo(const fs::path& folder,
                                                       const FaceFiles& files) {
    if (files.mask.empty())
        fail<FileError>(files.image.string(),
                        ": has no mask; a head-mask network learns from masks");
    Picture picture{
        std::vector<std::uint8_t>(std::size_t{picture_side} * picture_side * photo_channels)};
    const Tensor image = read_image(files.image);
    const auto mask_in = [&](const fs::path& file) {
        const Tensor mask = read_mask_file(file).mask;
        try {
            require_same_frame(mask, image);
        } catch (const FileError& error) {
            fail<FileError>(file.string(), ": ", error.what());
        }
        return at_usual_side(central_square(mask));
    };
    put(picture.bytes, photo_channels, 0, at_usual_side(central_square(image)));
    put(picture.bytes, photo_channels, mask_channel, mask_in(files.mask));
    Tensor known = Tensor::full({picture_side, picture_side, 1}, 1.0);
    if (!files.unknown.empty()) known = affine(mask_in(files.unknown), -1.0, 1.0).value();
    put(picture.bytes, photo_channels, known_channel, known);
    const fs::path person = folder / "persons" / (files.id + ".png");
    picture.has_person = fs::exists(person);
    if (picture.has_person) put(picture.bytes, photo_channels, person_channel, mask_in(person));
    return picture;
}

std::span<const std::uint8_t> HeadMaskExamples::drawn_cloth(Rng& rng) const {
    if (backgrounds_.empty() || rng.uniform() < 0.5) return {};
    return backgrounds_[static_cast<std::size_t>(rng.below(std::ssize(backgrounds_)))].bytes;
}

/// One of six is dark, as in a studio or at night.
void HeadMaskExamples::change_background(Example& example, Rng& rng) const {
    const Picture& picture = backgrounds_[static_cast<std::size_t>(
        rng.below(static_cast<std::int64_t>(backgrounds_.size())))];
    const ImagePlacement placement(10.0, 2.0, 0.3, rng);
    const ColorChange color(0.4, rng);
    const auto light = static_cast<float>(rng.uniform() < 1.0 / 6.0 ? 0.4 * rng.uniform() : 1.0);
    for (int i = 0; i < picture_side * picture_side; ++i) {
        Pixel& pixel = example.pixels[static_cast<std::size_t>(i)];
        const std::array<float, 3> behind =
            color(sample<3>(picture.bytes, placement.source(point_of(i))));
        const float person = pixel[person_channel];
        for (std::size_t c = 0; c < 3; ++c)
            pixel[c] = person * pixel[c] + (1.0F - person) * light * behind[c];
    }
}

void HeadMaskExamples::cover(Example& example, Rng& rng) const {
    const bool box = rng.uniform() < 0.5;
    const double width = rng.uniform(0.05, 0.25), height = rng.uniform(0.05, 0.25);
    const double x = rng.uniform(0.1, 0.9), y = rng.uniform(0.2, 1.0);
    const double angle = rng.uniform(0.0, std::numbers::pi);
    const double cosine = std::cos(angle), sine = std::sin(angle);
    const Cloth cloth(drawn_cloth(rng), rng);
    for (int i = 0; i < picture_side * picture_side; ++i) {
        const ImagePoint point = point_of(i);
        const double u = (cosine * (point[0] - x) + sine * (point[1] - y)) / width;
        const double v = (cosine * (point[1] - y) - sine * (point[0] - x)) / height;
        if (box ? std::max(std::abs(u), std::abs(v)) > 1.0 : u * u + v * v > 1.0) continue;
        Pixel& pixel = example.pixels[static_cast<std::size_t>(i)];
        cloth.paint(pixel, point);
        pixel[mask_channel] = 0.0F;
        pixel[known_channel] = 1.0F;
    }
}

HeadMaskExamples::Example HeadMaskExamples::varied(const HeadMaskVariation& variation,
                                                   Rng& rng) const {
    const Picture& photo = photos_[static_cast<std::size_t>(rng.below(std::ssize(photos_)))];
    const ImagePlacement placement(variation.degrees, variation.scale, variation.shift, rng);
    const ColorChange own_color(0.5 * variation.color, rng), color(variation.color, rng);
    const bool moves =
        photo.has_person && !backgrounds_.empty() && rng.uniform() < variation.background_share;
    const bool has_more_hair = rng.uniform() < variation.hair_share;
    const bool has_hat = rng.uniform() < variation.hat_share;
    const bool has_glasses = rng.uniform() < variation.glasses_share;
    const LargerHair hair(rng);
    const Glasses glasses(rng);
    const Hat hat(rng);
    const Cloth cloth(drawn_cloth(rng), rng);
    Example example{std::vector<Pixel>(std::size_t{picture_side} * picture_side)};
    for (int i = 0; i < picture_side * picture_side; ++i) {
        const ImagePoint aligned = placement.source(point_of(i));
        const ImagePoint source = has_more_hair ? hair.source(aligned) : aligned;
        Pixel& pixel = example.pixels[static_cast<std::size_t>(i)];
        pixel = sample<photo_channels>(photo.bytes, source);
        if (!is_inside(source)) pixel[known_channel] = 0.0F;
        if (has_glasses) put_on(glasses, aligned, pixel);
        if (has_hat) put_on(hat, cloth, aligned, moves, pixel);
        if (moves) recolor(pixel, own_color);
    }
    if (moves) change_background(example, rng);
    if (rng.uniform() < variation.cover_share) cover(example, rng);
    for (Pixel& pixel : example.pixels) recolor(pixel, color);
    return example;
}

HeadMaskExamples::Batch HeadMaskExamples::draw(std::int64_t count,
                                               const HeadMaskVariation& variation,
                                               const Rng& rng) const {
    const Shape one{count, picture_side, picture_side, 1};
    Batch batch{Tensor({count, picture_side, picture_side, 3}), Tensor(one), Tensor(one)};
    const auto images = batch.images.mutable_values<float>();
    const auto masks = batch.masks.mutable_values<float>();
    const auto known = batch.known.mutable_values<float>();
    parallel_items(count, [&](std::int64_t row, int /*thread*/) {
        Rng draws = rng.split(static_cast<std::uint64_t>(row));
        const Example example = varied(variation, draws);
        Tensor image({picture_side, picture_side, 3});
        const auto values = image.mutable_values<float>();
        const std::size_t first = static_cast<std::size_t>(row) * picture_side * picture_side;
        for (std::size_t i = 0; i < example.pixels.size(); ++i) {
            std::copy_n(example.pixels[i].begin(), 3,
                        values.begin() + 3 * static_cast<std::ptrdiff_t>(i));
            masks[first + i] = example.pixels[i][mask_channel];
            known[first + i] = example.pixels[i][known_channel];
        }
        if (draws.uniform() < variation.blur_share) {
            const auto coarse = static_cast<int>(draws.uniform(0.2, 0.8) * picture_side);
            image = resize_image(resize_image(image, coarse, coarse), picture_side, picture_side);
        }
        const double noise = 0.05 * std::pow(draws.uniform(), 3.0);
        const Tensor grain = draws.normal({picture_side, picture_side, 3}, 0.0, noise);
        image = clamp(Variable(image) + Variable(grain), 0.0, 1.0).value();
        std::ranges::copy(image.values<float>(),
                          images.begin() + static_cast<std::ptrdiff_t>(3 * first));
    });
    return batch;
}

}  // namespace stymo
