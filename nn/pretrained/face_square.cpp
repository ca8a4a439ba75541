#include "nn/pretrained/face_square.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/parallel.h"

namespace stymo {

namespace {

/// Half of the square's side, in units of the longer half side of the box around the points.
constexpr double square_margin = 1.25;

[[nodiscard]] Eigen::Vector2d mean_point(const FacePoints& points, std::size_t first,
                                         std::size_t last) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (std::size_t k = first; k <= last; ++k) sum += points[k];
    return sum / static_cast<double>(last - first + 1);
}

/// Adds `weight` times the pixel values at (x, y), bilinear between pixel centres.
void add_sample(const Tensor& photo, const Eigen::Vector2d& at, float weight, float* sum) {
    const std::int64_t height = photo.shape(0);
    const std::int64_t width = photo.shape(1);
    const std::int64_t channels = photo.shape(2);
    const double x = std::clamp(at.x() - 0.5, 0.0, static_cast<double>(width - 1));
    const double y = std::clamp(at.y() - 0.5, 0.0, static_cast<double>(height - 1));
    const auto left = static_cast<std::int64_t>(x);
    const auto top = static_cast<std::int64_t>(y);
    const std::int64_t right = std::min(left + 1, width - 1);
    const std::int64_t bottom = std::min(top + 1, height - 1);
    const auto fx = static_cast<float>(x - static_cast<double>(left));
    const auto fy = static_cast<float>(y - static_cast<double>(top));
    const float* values = photo.values<float>().data();
    const auto pixel = [&](std::int64_t row, std::int64_t column) {
        return values + (row * width + column) * channels;
    };
    const float *a = pixel(top, left), *b = pixel(top, right), *c = pixel(bottom, left),
                *d = pixel(bottom, right);
    for (std::int64_t k = 0; k < channels; ++k)
        sum[k] += weight * ((1.0F - fy) * ((1.0F - fx) * a[k] + fx * b[k]) +
                            fy * ((1.0F - fx) * c[k] + fx * d[k]));
}

bool shows(const Tensor& photo, const Eigen::Vector2d& at) {
    return at.minCoeff() >= 0.0 && at.x() <= static_cast<double>(photo.shape(1)) &&
           at.y() <= static_cast<double>(photo.shape(0));
}

}  // namespace

Eigen::Vector2d FaceSquare::coordinates(const Eigen::Vector2d& point) const {
    const Eigen::Vector2d offset = (point - center) / axis.squaredNorm();
    return {offset.dot(axis), offset.dot(Eigen::Vector2d(-axis.y(), axis.x()))};
}

FaceSquare square_around(const FacePoints& points) {
    const Eigen::Vector2d across = mean_point(points, 42, 47) - mean_point(points, 36, 41);
    if (!(across.norm() > 0.0)) fail<NumericError>("landmarks: both eyes are at the same point");
    const FaceSquare upright{points[30], across.normalized()};
    Eigen::Vector2d low = upright.coordinates(points[0]);
    Eigen::Vector2d high = low;
    for (const Eigen::Vector2d& point : points) {
        const Eigen::Vector2d at = upright.coordinates(point);
        low = low.cwiseMin(at);
        high = high.cwiseMax(at);
    }
    const double half = 0.5 * (high - low).maxCoeff();
    return {upright.point(0.5 * (low + high)), square_margin * half * upright.axis};
}

FaceSquare square_of_box(double left, double top, double width, double height) {
    // The box reaches from the brows to just below the mouth.
    return {{left + 0.5 * width, top + 0.56 * height}, {0.62 * width, 0.0}};
}

Midline midline_of(const FacePoints& points) {
    const Eigen::Vector2d bridge = mean_point(points, 27, 30);
    const Eigen::Vector2d down = (points[57] + points[51]) / 2.0 - bridge;
    if (!(down.norm() > 0.0)) fail<NumericError>("landmarks: nose and lips are at the same point");
    return {bridge, Eigen::Vector2d(-down.y(), down.x()).normalized()};
}

Tensor image_in_square(const Tensor& photo, const FaceSquare& square, std::int64_t side,
                       const std::optional<Midline>& midline) {
    if (photo.rank() != 3 || photo.size() == 0)
        fail<ShapeError>("[face square] a photo is (height, width, channels); got ", photo.shape());
    Tensor image = Tensor::zeros({side, side, photo.shape(2)});
    const double step = 2.0 / static_cast<double>(side);
    // Samples along each side of a target pixel: enough that hardly any pixel of the photo is
    // skipped.
    const auto taps =
        std::clamp<std::int64_t>(std::llround(std::ceil(step * square.axis.norm() - 0.4)), 1, 16);
    const float share = 1.0F / static_cast<float>(taps * taps);
    float* values = image.mutable_values<float>().data();
    parallel_for(side, 16, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t row = begin; row < end; ++row)
            for (std::int64_t column = 0; column < side; ++column)
                for (std::int64_t tap = 0; tap < taps * taps; ++tap) {
                    const auto inside = [&](std::int64_t pixel, std::int64_t part) {
                        return (static_cast<double>(pixel) +
                                (static_cast<double>(part) + 0.5) / static_cast<double>(taps)) *
                                   step -
                               1.0;
                    };
                    Eigen::Vector2d at =
                        square.point({inside(column, tap % taps), inside(row, tap / taps)});
                    if (midline && !shows(photo, at) && shows(photo, midline->mirrored(at)))
                        at = midline->mirrored(at);
                    add_sample(photo, at, share, values + (row * side + column) * photo.shape(2));
                }
    });
    return image;
}

std::size_t mirrored_point(std::size_t k) {
    static constexpr std::array<std::size_t, 68> partner{
        16, 15, 14, 13, 12, 11, 10, 9,  8,  7,  6,  5,  4,  3,  2,  1,  0,  26, 25, 24, 23, 22, 21,
        20, 19, 18, 17, 27, 28, 29, 30, 35, 34, 33, 32, 31, 45, 44, 43, 42, 47, 46, 39, 38, 37, 36,
        41, 40, 54, 53, 52, 51, 50, 49, 48, 59, 58, 57, 56, 55, 64, 63, 62, 61, 60, 67, 66, 65};
    return partner.at(k);
}

Variable unit_contrast(const Variable& images) {
    const std::vector<int> axes{1, 2, 3};
    const Variable centered = images - mean(images, axes);
    return centered / sqrt(mean(square(centered), axes) + 1e-3);
}

}  // namespace stymo
