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

/// A map of the target's pixels to those of a source: turned, scaled, shifted, mirrored.
struct Placement {
    double cosine = 1.0, sine = 0.0, x = 0.0, y = 0.0;
    bool mirrored = false;

    [[nodiscard]] std::array<double, 2> source(int column, int row) const {
        constexpr double middle = 0.5 * (picture_side - 1);
        const double u = (mirrored ? middle - column : column - middle), v = row - middle;
        return {middle + x + cosine * u - sine * v, middle + y + sine * u + cosine * v};
    }
};

double between(Rng& rng, double low, double high) {
    return low + (high - low) * rng.uniform();
}

Placement drawn_placement(double degrees, double scale, double shift, Rng& rng) {
    const double angle = between(rng, -degrees, degrees) * std::numbers::pi / 180.0;
    const double shrinking = std::pow(scale, between(rng, -1.0, 1.0));
    return {shrinking * std::cos(angle), shrinking * std::sin(angle),
            picture_side * between(rng, -shift, shift), picture_side * between(rng, -shift, shift),
            rng.uniform() < 0.5};
}

/// The bilinear sample of a picture; pixels beyond its border repeat the border.
template <int channels>
std::array<float, channels> sample(std::span<const std::uint8_t> bytes, double x, double y) {
    const double column = std::clamp(x, 0.0, picture_side - 1.001),
                 row = std::clamp(y, 0.0, picture_side - 1.001);
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

bool is_inside(const std::array<double, 2>& point) {
    return point[0] >= 0.0 && point[0] <= picture_side - 1 && point[1] >= 0.0 &&
           point[1] <= picture_side - 1;
}

/// Changes the exposure and the balance of colours, and takes some of the colour away.
class ColorChange {
public:
    ColorChange(double strength, Rng& rng)
        : gamma_(static_cast<float>(std::exp(strength * between(rng, -1.5, 1.5)))),
          saturation_(rng.uniform() < 0.1
                          ? 0.0F
                          : static_cast<float>(1.0 + strength * between(rng, -1.5, 1.0))) {
        const double gain = between(rng, -1.0, 1.0);
        for (float& factor : gains_)
            factor =
                static_cast<float>(std::exp(strength * (gain + 0.4 * between(rng, -1.0, 1.0))));
    }

    void apply(Pixel& pixel) const {
        const float grey = 0.3F * pixel[0] + 0.59F * pixel[1] + 0.11F * pixel[2];
        for (std::size_t c = 0; c < 3; ++c) {
            const float value = grey + saturation_ * (pixel[c] - grey);
            pixel[c] =
                std::clamp(gains_[c] * std::pow(std::clamp(value, 0.0F, 1.0F), gamma_), 0.0F, 1.0F);
        }
    }

private:
    float gamma_;
    float saturation_;
    std::array<float, 3> gains_{};
};

}  // namespace

struct HeadMaskExamples::Example {
    std::vector<Pixel> pixels;
};

void HeadMaskVariation::describe(ConfigSchema& schema) {
    schema.number("variation.background_share", background_share, 0.0, 1.0,
                  "share of the cut-out people that get another background");
    schema.number("variation.cover_share", cover_share, 0.0, 1.0,
                  "share of the photos with something in front of the head");
    schema.number("variation.degrees", degrees, 0.0, 180.0, "largest rotation");
    schema.number("variation.scale", scale, 1.0, 4.0, "largest enlargement");
    schema.number("variation.shift", shift, 0.0, 1.0, "largest shift, in units of the side");
    schema.number("variation.color", color, 0.0, 1.0, "strength of the changes of colour");
    schema.number("variation.blur_share", blur_share, 0.0, 1.0,
                  "share of the photos that lose resolution");
}

HeadMaskExamples::HeadMaskExamples(const fs::path& folder) {
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
    put(picture.bytes, photo_channels, 0, at_usual_side(read_image(files.image)));
    put(picture.bytes, photo_channels, mask_channel,
        at_usual_side(read_mask_file(files.mask).mask));
    Tensor known = Tensor::full({picture_side, picture_side, 1}, 1.0);
    if (!files.unknown.empty())
        known = affine(at_usual_side(read_mask_file(files.unknown).mask), -1.0, 1.0).value();
    put(picture.bytes, photo_channels, known_channel, known);
    const fs::path person = folder / "persons" / (files.id + ".png");
    picture.has_person = fs::exists(person);
    if (picture.has_person)
        put(picture.bytes, photo_channels, person_channel,
            at_usual_side(read_mask_file(person).mask));
    return picture;
}

void HeadMaskExamples::change_background(Example& example, Rng& rng) const {
    const Picture& picture = backgrounds_[static_cast<std::size_t>(
        rng.below(static_cast<std::int64_t>(backgrounds_.size())))];
    const Placement placement = drawn_placement(10.0, 2.0, 0.3, rng);
    const ColorChange color(0.4, rng);
    for (int i = 0; i < picture_side * picture_side; ++i) {
        Pixel& pixel = example.pixels[static_cast<std::size_t>(i)];
        const auto [x, y] = placement.source(i % picture_side, i / picture_side);
        const std::array<float, 3> behind = sample<3>(picture.bytes, x, y);
        Pixel changed{behind[0], behind[1], behind[2]};
        color.apply(changed);
        const float person = pixel[person_channel];
        for (std::size_t c = 0; c < 3; ++c)
            pixel[c] = person * pixel[c] + (1.0F - person) * changed[c];
    }
}

/// Half of the covers lie where hats are, the others anywhere.
void HeadMaskExamples::cover(Example& example, Rng& rng) const {
    const bool hat = rng.uniform() < 0.5, box = rng.uniform() < 0.5;
    const double width = picture_side * (hat ? between(rng, 0.2, 0.45) : between(rng, 0.05, 0.25));
    const double height =
        picture_side * (hat ? between(rng, 0.06, 0.18) : between(rng, 0.05, 0.25));
    const double x = picture_side * (hat ? between(rng, 0.35, 0.65) : between(rng, 0.1, 0.9));
    const double y = picture_side * (hat ? between(rng, 0.0, 0.25) : between(rng, 0.2, 1.0));
    const double angle = hat ? between(rng, -0.3, 0.3) : between(rng, 0.0, std::numbers::pi);
    const double cosine = std::cos(angle), sine = std::sin(angle);
    const bool plain = backgrounds_.empty() || rng.uniform() < 0.5;
    Pixel paint{};
    for (std::size_t c = 0; c < 3; ++c) paint[c] = static_cast<float>(rng.uniform());
    const Placement texture = drawn_placement(180.0, 3.0, 0.4, rng);
    const std::size_t from =
        plain ? 0 : static_cast<std::size_t>(rng.below(std::ssize(backgrounds_)));
    for (int i = 0; i < picture_side * picture_side; ++i) {
        const double u = (cosine * (i % picture_side - x) + sine * (i / picture_side - y)) / width;
        const double v = (cosine * (i / picture_side - y) - sine * (i % picture_side - x)) / height;
        if (box ? std::max(std::abs(u), std::abs(v)) > 1.0 : u * u + v * v > 1.0) continue;
        Pixel& pixel = example.pixels[static_cast<std::size_t>(i)];
        if (!plain) {
            const auto [column, row] = texture.source(i % picture_side, i / picture_side);
            std::ranges::copy(sample<3>(backgrounds_[from].bytes, column, row), paint.begin());
        }
        std::copy_n(paint.begin(), 3, pixel.begin());
        pixel[mask_channel] = 0.0F;
        pixel[known_channel] = 1.0F;
    }
}

HeadMaskExamples::Example HeadMaskExamples::varied(const HeadMaskVariation& variation,
                                                   Rng& rng) const {
    const Picture& photo = photos_[static_cast<std::size_t>(rng.below(std::ssize(photos_)))];
    const Placement placement =
        drawn_placement(variation.degrees, variation.scale, variation.shift, rng);
    const ColorChange own_color(0.5 * variation.color, rng), color(variation.color, rng);
    const bool moves =
        photo.has_person && !backgrounds_.empty() && rng.uniform() < variation.background_share;
    Example example{std::vector<Pixel>(std::size_t{picture_side} * picture_side)};
    for (int i = 0; i < picture_side * picture_side; ++i) {
        const auto source = placement.source(i % picture_side, i / picture_side);
        Pixel& pixel = example.pixels[static_cast<std::size_t>(i)];
        pixel = sample<photo_channels>(photo.bytes, source[0], source[1]);
        if (moves) own_color.apply(pixel);
        if (!is_inside(source)) pixel[known_channel] = 0.0F;
    }
    if (moves) change_background(example, rng);
    if (rng.uniform() < variation.cover_share) cover(example, rng);
    for (Pixel& pixel : example.pixels) color.apply(pixel);
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
            const auto coarse = static_cast<int>(between(draws, 0.2, 0.8) * picture_side);
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
