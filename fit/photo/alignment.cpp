#include "fit/photo/alignment.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/io/image.h"
#include "core/ops/resample.h"
#include "core/parallel.h"
#include "nn/known_pixels.h"

namespace stymo {
namespace {

/// Half of the side of the smallest upright square around the alignment's own.
double half_extent(const Alignment& alignment) {
    return alignment.axis.lpNorm<1>();
}

/// A rectangle of whole pixels; right and bottom are the first column and row outside it.
struct Box {
    std::int64_t left, top, right, bottom;
};

/// Index of position i in a row of `length` pixels that is continued by reflection, without
/// repeating the outermost pixel.
std::int64_t reflected(std::int64_t i, std::int64_t length) {
    if (length == 1) return 0;
    const std::int64_t period = 2 * (length - 1);
    const std::int64_t phase = ((i % period) + period) % period;
    return std::min(phase, period - phase);
}

/// The box of the photo, which is continued by reflection.
Tensor reflected_part(const Tensor& photo, const Box& box) {
    const std::int64_t height = photo.shape(0);
    const std::int64_t width = photo.shape(1);
    const std::int64_t channels = photo.shape(2);
    Tensor part({box.bottom - box.top, box.right - box.left, channels});
    const std::span<const float> from = photo.values<float>();
    const std::span<float> to = part.mutable_values<float>();
    std::int64_t at = 0;
    for (std::int64_t row = box.top; row < box.bottom; ++row)
        for (std::int64_t column = box.left; column < box.right; ++column, at += channels)
            std::copy_n(from.begin() +
                            (reflected(row, height) * width + reflected(column, width)) * channels,
                        channels, to.begin() + at);
    return part;
}

/// Gaussian blur along an axis that is continued by its mirror image.
ResampleMatrix gaussian_matrix(int size, double deviation) {
    const int reach = static_cast<int>(std::ceil(4.0 * deviation));
    std::vector<double> weights;
    double sum = 0.0;
    for (int i = -reach; i <= reach; ++i) {
        weights.push_back(std::exp(-0.5 * (i / deviation) * (i / deviation)));
        sum += weights.back();
    }
    std::vector<ResampleMatrix::Entry> entries;
    for (int row = 0; row < size; ++row)
        for (int i = -reach; i <= reach; ++i)
            entries.push_back({row, static_cast<int>(reflected(row + i, size)),
                               weights[static_cast<std::size_t>(i + reach)] / sum});
    return {size, size, std::move(entries)};
}

/// A Gaussian blur of this deviation in pixels. A wide blur is computed on a smaller copy.
Tensor gaussian_blur(const Tensor& image, double deviation) {
    const double factor = std::max(1.0, deviation / 3.0);
    const auto height = static_cast<int>(image.shape(0));
    const auto width = static_cast<int>(image.shape(1));
    const int rows = std::max(1, static_cast<int>(std::lround(height / factor)));
    const int columns = std::max(1, static_cast<int>(std::lround(width / factor)));
    const Tensor small =
        resize_image(image, rows, columns).reshaped({1, rows, columns, image.shape(2)});
    const Variable blurred = resample(small, gaussian_matrix(rows, deviation * rows / height),
                                      gaussian_matrix(columns, deviation * columns / width));
    return resize_bilinear(blurred, height, width).value().reshaped(image.shape());
}

float median_of_channel(const Tensor& image, std::int64_t channel) {
    std::vector<float> values;
    const std::span<const float> all = image.values<float>();
    for (auto at = static_cast<std::size_t>(channel); at < all.size();
         at += static_cast<std::size_t>(image.shape(2)))
        values.push_back(all[at]);
    const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), half, values.end());
    return *half;
}

/// Widths of the strips added to an image.
struct Padding {
    std::int64_t left, top, right, bottom;
};

/// How far outside the photo a pixel is: 0 at the border of the padding, 1 at the outer rim,
/// negative inside.
double outsideness(std::int64_t at, std::int64_t size, std::int64_t before, std::int64_t after) {
    constexpr double never = -1e9;
    const double first =
        before > 0 ? 1.0 - static_cast<double>(at) / static_cast<double>(before) : never;
    const double last =
        after > 0 ? 1.0 - static_cast<double>(size - 1 - at) / static_cast<double>(after) : never;
    return std::max(first, last);
}

/// image += (other - image) * weight(outsideness) for each pixel.
template <class Other, class Weight>
void fade(Tensor& image, const Padding& padding, const Other& other, const Weight& weight) {
    const std::int64_t height = image.shape(0);
    const std::int64_t width = image.shape(1);
    const std::int64_t channels = image.shape(2);
    const std::span<float> values = image.mutable_values<float>();
    for (std::int64_t row = 0; row < height; ++row) {
        const double down = outsideness(row, height, padding.top, padding.bottom);
        for (std::int64_t column = 0; column < width; ++column) {
            const double outside =
                std::max(down, outsideness(column, width, padding.left, padding.right));
            const auto share = static_cast<float>(std::clamp(weight(outside), 0.0, 1.0));
            if (share == 0.0F) continue;
            for (std::int64_t channel = 0; channel < channels; ++channel) {
                const auto at =
                    static_cast<std::size_t>((row * width + column) * channels + channel);
                values[at] += (other(at, channel) - values[at]) * share;
            }
        }
    }
}

void fade_out(Tensor& image, const Padding& padding, double side) {
    const Tensor blurred = gaussian_blur(image, 0.02 * side);
    const std::span<const float> blur = blurred.values<float>();
    fade(
        image, padding, [&](std::size_t at, std::int64_t) { return blur[at]; },
        [](double outside) { return 3.0 * outside + 1.0; });
    std::vector<float> medians;
    for (std::int64_t channel = 0; channel < image.shape(2); ++channel)
        medians.push_back(median_of_channel(image, channel));
    fade(
        image, padding,
        [&](std::size_t, std::int64_t channel) {
            return medians[static_cast<std::size_t>(channel)];
        },
        [](double outside) { return outside; });
}

/// An image and the square in its pixels.
struct PhotoPart {
    Tensor image;
    Alignment square;
};

Alignment moved(const Alignment& square, double left, double top) {
    return {square.center - Eigen::Vector2d(left, top), square.axis};
}

Alignment scaled(const Alignment& square, double factor) {
    return {square.center * factor, square.axis * factor};
}

/// The whole pixels around the square, whose coordinates refer to pixel centres as in FFHQ's own
/// program.
Box bounds(const Alignment& square) {
    const double reach = half_extent(square);
    const auto below = [](double value) {
        return static_cast<std::int64_t>(std::floor(value - 0.5));
    };
    const auto above = [](double value) {
        return static_cast<std::int64_t>(std::ceil(value - 0.5));
    };
    const auto [x, y] = std::pair(square.center.x(), square.center.y());
    return {below(x - reach), below(y - reach), above(x + reach), above(y + reach)};
}

/// The part of the photo around the square with a border, reduced by an integer factor for which
/// the square keeps at least twice the pixels of the output.
PhotoPart cut_out(const Tensor& photo, const Alignment& alignment, std::int64_t output_side,
                  std::int64_t& border) {
    const double ratio = alignment.side() / static_cast<double>(output_side);
    const auto factor =
        std::max<std::int64_t>(1, static_cast<std::int64_t>(std::floor(ratio * 0.5)));
    const Alignment square = scaled(alignment, 1.0 / static_cast<double>(factor));
    border = std::max<std::int64_t>(std::llround(0.1 * square.side()), 3);
    const Box box = bounds(square);
    const std::int64_t rows = std::max<std::int64_t>(photo.shape(0) / factor, 1);
    const std::int64_t columns = std::max<std::int64_t>(photo.shape(1) / factor, 1);
    const std::int64_t left = std::clamp<std::int64_t>(box.left - border, 0, columns - 1);
    const std::int64_t top = std::clamp<std::int64_t>(box.top - border, 0, rows - 1);
    const std::int64_t width =
        std::clamp<std::int64_t>(box.right + border, left + 1, columns) - left;
    const std::int64_t height = std::clamp<std::int64_t>(box.bottom + border, top + 1, rows) - top;
    const Tensor part =
        image_part(photo, top * factor, left * factor, height * factor, width * factor);
    return {resize_image(part, static_cast<int>(height), static_cast<int>(width)),
            moved(square, static_cast<double>(left), static_cast<double>(top))};
}

/// Extends the image where the square reaches beyond it or close to its border.
PhotoPart padded(PhotoPart part, std::int64_t border) {
    const Box box = bounds(part.square);
    const std::int64_t height = part.image.shape(0);
    const std::int64_t width = part.image.shape(1);
    Padding padding{border - box.left, border - box.top, box.right - width + border,
                    box.bottom - height + border};
    if (std::max({padding.left, padding.top, padding.right, padding.bottom}) <= border - 4)
        return part;
    for (std::int64_t* strip : {&padding.left, &padding.top, &padding.right, &padding.bottom})
        *strip = std::max<std::int64_t>(*strip, std::llround(0.3 * part.square.side()));
    Tensor image = reflected_part(
        part.image, {-padding.left, -padding.top, width + padding.right, height + padding.bottom});
    fade_out(image, padding, part.square.side());
    return {std::move(image), moved(part.square, -static_cast<double>(padding.left),
                                    -static_cast<double>(padding.top))};
}

/// side x side samples of the square, bilinear.
Tensor sampled_square(const PhotoPart& part, std::int64_t side) {
    // No structured binding: Clang 14 cannot capture one.
    const auto& image = part.image;
    const auto& square = part.square;
    const std::int64_t channels = image.shape(2);
    const auto last_row = static_cast<double>(image.shape(0) - 1);
    const auto last_column = static_cast<double>(image.shape(1) - 1);
    Tensor result({side, side, channels});
    const float* from = image.values<float>().data();
    float* const to = result.mutable_values<float>().data();
    constexpr std::int64_t rows_of_a_chunk = 16;
    parallel_for(side, rows_of_a_chunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin * side; i < end * side; ++i) {
            const std::int64_t to_row = i / side, to_column = i % side;
            const double u =
                (2.0 * static_cast<double>(to_column) + 1.0) / static_cast<double>(side) - 1.0;
            const double v =
                (2.0 * static_cast<double>(to_row) + 1.0) / static_cast<double>(side) - 1.0;
            const Eigen::Vector2d point = square.point(u, v);
            const double x = std::clamp(point.x() - 0.5, 0.0, last_column);
            const double y = std::clamp(point.y() - 0.5, 0.0, last_row);
            const auto column = std::min(static_cast<std::int64_t>(x),
                                         std::max<std::int64_t>(image.shape(1) - 2, 0));
            const auto row = std::min(static_cast<std::int64_t>(y),
                                      std::max<std::int64_t>(image.shape(0) - 2, 0));
            const auto across = static_cast<float>(x - static_cast<double>(column));
            const auto down = static_cast<float>(y - static_cast<double>(row));
            const float* const pixel = from + (row * image.shape(1) + column) * channels;
            const float* const below =
                image.shape(0) > 1 ? pixel + image.shape(1) * channels : pixel;
            const std::int64_t right = image.shape(1) > 1 ? channels : 0;
            for (std::int64_t c = 0; c < channels; ++c) {
                const float upper = pixel[c] + (pixel[c + right] - pixel[c]) * across;
                const float lower = below[c] + (below[c + right] - below[c]) * across;
                to[i * channels + c] = upper + (lower - upper) * down;
            }
        }
    });
    return result;
}

}  // namespace

double Alignment::angle() const {
    return std::atan2(axis.y(), axis.x());
}

Alignment ffhq_alignment(const Landmarks& landmarks) {
    const Eigen::Vector2d left_eye = mean_landmark(landmarks, 36, 41);
    const Eigen::Vector2d right_eye = mean_landmark(landmarks, 42, 47);
    const Eigen::Vector2d eyes = (left_eye + right_eye) / 2;
    const Eigen::Vector2d between_eyes = right_eye - left_eye;
    const Eigen::Vector2d eyes_to_mouth = (landmarks[48] + landmarks[54]) / 2 - eyes;
    const Eigen::Vector2d direction =
        between_eyes + Eigen::Vector2d(eyes_to_mouth.y(), -eyes_to_mouth.x());
    const double half = std::max(2.0 * between_eyes.norm(), 1.8 * eyes_to_mouth.norm());
    const double scale = half / direction.norm();
    if (!(half > 0.0) || !std::isfinite(scale))
        fail<NumericError>("[alignment] the landmarks have no extent");
    return {eyes + 0.1 * eyes_to_mouth, direction * scale};
}

bool is_aligned(const Alignment& alignment, std::int64_t width, std::int64_t height) {
    // Tolerances of is_aligned. Photos of CelebA-HQ, which were aligned by five other landmarks,
    // differ (99 of 100) by a shift below 0.03, a log scale below 0.11 and a rotation below 4
    // degrees. Looser crops of FFHQ differ by a log scale of 0.34 to 0.42.
    constexpr double largest_shift = 0.05;
    constexpr double largest_stretch = 0.17;
    constexpr double largest_angle = 6.0 * std::numbers::pi / 180.0;
    if (width != height) return false;
    const auto side = static_cast<double>(width);
    const Eigen::Vector2d shift = alignment.center / side - Eigen::Vector2d(0.5, 0.5);
    return shift.lpNorm<Eigen::Infinity>() <= largest_shift &&
           std::abs(std::log(alignment.side() / side)) <= largest_stretch &&
           std::abs(alignment.angle()) <= largest_angle;
}

Tensor aligned_crop(const Tensor& photo, const Alignment& alignment, std::int64_t side,
                    std::int64_t samples_of_a_pixel) {
    if (photo.rank() != 3 || photo.size() == 0 || side <= 0)
        fail<ShapeError>("[alignment] cannot cut ", side, " x ", side, " pixels out of ",
                         photo.shape());
    std::int64_t border = 0;
    const PhotoPart part = padded(cut_out(photo, alignment, side, border), border);
    Tensor crop = resize_image(sampled_square(part, samples_of_a_pixel * side),
                               static_cast<int>(side), static_cast<int>(side));
    for (float& value : crop.mutable_values<float>()) value = std::clamp(value, 0.0F, 1.0F);
    return crop;
}

Tensor known_crop(const Alignment& alignment, std::int64_t side, std::int64_t height,
                  std::int64_t width, const Tensor& photo_known) {
    cv::Mat sums;  // the number of unknown pixels above and to the left
    if (photo_known.defined()) {
        cv::Mat unknown(static_cast<int>(height), static_cast<int>(width), CV_8U);
        std::ranges::transform(photo_known.values<float>(), unknown.begin<unsigned char>(),
                               [](float value) { return value == 0.0F ? 1 : 0; });
        cv::integral(unknown, sums, CV_32S);
    }
    const double reach = 2.0 * half_extent(alignment) / static_cast<double>(side);
    Tensor known = Tensor::zeros({side, side, 1});
    const std::span<float> values = known.mutable_values<float>();
    for (std::int64_t i = 0; i < side * side; ++i) {
        const auto at = [&](std::int64_t index) {
            return (2.0 * static_cast<double>(index) + 1.0) / static_cast<double>(side) - 1.0;
        };
        const Eigen::Vector2d point = alignment.point(at(i % side), at(i / side));
        constexpr double rounding = 1e-6;
        const Eigen::Vector2d low = point.array() - reach + rounding,
                              high = point.array() + reach - rounding;
        if (low.minCoeff() < 0.0 || high.x() > static_cast<double>(width) ||
            high.y() > static_cast<double>(height))
            continue;
        const int left = cvFloor(low.x()), top = cvFloor(low.y()), right = cvCeil(high.x()),
                  bottom = cvCeil(high.y());
        const bool is_known =
            sums.empty() || sums.at<int>(bottom, right) - sums.at<int>(top, right) ==
                                sums.at<int>(bottom, left) - sums.at<int>(top, left);
        values[static_cast<std::size_t>(i)] = is_known ? 1.0F : 0.0F;
    }
    return unless_all_known(known);
}

Landmarks aligned_landmarks(const Landmarks& landmarks, const Alignment& alignment,
                            std::int64_t side) {
    const double half_side = static_cast<double>(side) / 2.0;
    const double square = alignment.axis.squaredNorm();
    Landmarks result;
    for (std::size_t i = 0; i < result.size(); ++i) {
        const Eigen::Vector2d offset = landmarks[i] - alignment.center;
        const Eigen::Vector2d inside(offset.dot(alignment.axis), offset.dot(alignment.down_axis()));
        result[i] = (inside / square + Eigen::Vector2d::Ones()) * half_side;
    }
    return result;
}

double share_outside(const Alignment& alignment, std::int64_t width, std::int64_t height) {
    constexpr int samples = 64;
    int outside = 0;
    for (int i = 0; i < samples; ++i)
        for (int j = 0; j < samples; ++j) {
            const double u = (2.0 * i + 1.0) / samples - 1.0;
            const double v = (2.0 * j + 1.0) / samples - 1.0;
            const Eigen::Vector2d point = alignment.point(u, v);
            if (point.minCoeff() < 0.0 || point.x() > static_cast<double>(width) ||
                point.y() > static_cast<double>(height))
                ++outside;
        }
    return static_cast<double>(outside) / (samples * samples);
}

}  // namespace stymo
