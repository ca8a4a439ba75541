#include "render/rasterizer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {

namespace {

using Triangle = std::array<std::int32_t, 3>;

constexpr double near_depth = 1e-3;
constexpr float nothing = std::numeric_limits<float>::infinity();

/// The samples of some pixel rows.
struct SampleRows {
    std::int64_t first_row;  ///< in samples
    std::int64_t rows;
    std::int64_t columns;
    std::size_t channels;
    std::vector<float> depth;
    std::vector<float> color;
    std::vector<std::int32_t> triangle;
};

/// Positive on one side of the line from a to b, negative on the other. Both triangles of an edge
/// get the same number but for its sign, so that no sample falls between them.
class Edge {
public:
    Edge(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
        const bool swapped = std::pair(b[0], b[1]) < std::pair(a[0], a[1]);
        const Eigen::Vector3d &from = swapped ? b : a, &to = swapped ? a : b;
        x_ = from[0];
        y_ = from[1];
        along_x_ = swapped ? from[0] - to[0] : to[0] - from[0];
        along_y_ = swapped ? from[1] - to[1] : to[1] - from[1];
    }
    [[nodiscard]] double operator()(double x, double y) const {
        return along_x_ * (y - y_) - along_y_ * (x - x_);
    }

private:
    double x_, y_, along_x_, along_y_;
};

/// `paint` gets weights whose sum is 1 / depth.
template <class Paint>
void draw(std::int32_t index, const std::array<Eigen::Vector3d, 3>& corners, const Paint& paint,
          SampleRows& target) {
    const auto [low_x, high_x] = std::minmax({corners[0][0], corners[1][0], corners[2][0]});
    const auto [low_y, high_y] = std::minmax({corners[0][1], corners[1][1], corners[2][1]});
    const auto bottom = static_cast<double>(target.first_row + target.rows);
    if (high_x < 0.0 || low_x > static_cast<double>(target.columns) ||
        high_y < static_cast<double>(target.first_row) || low_y > bottom)
        return;
    const std::array<Edge, 3> edges{Edge(corners[1], corners[2]), Edge(corners[2], corners[0]),
                                    Edge(corners[0], corners[1])};
    const double area = edges[2](corners[2][0], corners[2][1]);
    if (area == 0.0 || !std::isfinite(area)) return;
    // Samples stand at integers plus a half.
    const auto first_row =
        std::max(target.first_row, static_cast<std::int64_t>(std::ceil(low_y - 0.5)));
    const auto last_row = std::min(target.first_row + target.rows - 1,
                                   static_cast<std::int64_t>(std::floor(high_y - 0.5)));
    const auto first_column =
        std::max(std::int64_t{0}, static_cast<std::int64_t>(std::ceil(low_x - 0.5)));
    const auto last_column =
        std::min(target.columns - 1, static_cast<std::int64_t>(std::floor(high_x - 0.5)));
    for (std::int64_t row = first_row; row <= last_row; ++row) {
        for (std::int64_t column = first_column; column <= last_column; ++column) {
            const double x = static_cast<double>(column) + 0.5;
            const double y = static_cast<double>(row) + 0.5;
            const std::array<double, 3> barycentric{edges[0](x, y) / area, edges[1](x, y) / area,
                                                    edges[2](x, y) / area};
            if (barycentric[0] < 0.0 || barycentric[1] < 0.0 || barycentric[2] < 0.0) continue;
            // 1 / depth is linear on the screen, and so is everything divided by depth.
            std::array<double, 3> weight{};
            for (std::size_t k = 0; k < 3; ++k) weight[k] = barycentric[k] / corners[k][2];
            const double depth = 1.0 / (weight[0] + weight[1] + weight[2]);
            const auto sample =
                static_cast<std::size_t>((row - target.first_row) * target.columns + column);
            if (static_cast<float>(depth) >= target.depth[sample]) continue;
            if (!paint(index, weight, depth, &target.color[target.channels * sample])) continue;
            target.depth[sample] = static_cast<float>(depth);
            target.triangle[sample] = index;
        }
    }
}

/// Corners of all vertices in samples (x, y) and depth.
[[nodiscard]] std::vector<Eigen::Vector3d> projected(const Tensor& vertices, const Camera& camera,
                                                     double samples_per_unit) {
    const auto values = vertices.values<float>();
    std::vector<Eigen::Vector3d> result(values.size() / 3);
    for (std::size_t vertex = 0; vertex < result.size(); ++vertex) {
        const Eigen::Map<const Eigen::Vector3f> point(&values[3 * vertex]);
        result[vertex] = project(camera, point.cast<double>());
        result[vertex].head<2>() *= samples_per_unit;
    }
    return result;
}

void check(const Tensor& vertices, std::span<const Triangle> triangles,
           const RasterSettings& settings) {
    if (vertices.rank() != 2 || vertices.shape(1) != 3)
        fail<ShapeError>("[rasterize] needs vertices (V, 3); got ", vertices.shape());
    if (settings.width < 1 || settings.height < 1 || settings.samples_per_side < 1) {
        fail<ValueError>("[rasterize] width, height and samples per side must be at least 1; got ",
                         settings.width, ", ", settings.height, ", ", settings.samples_per_side);
    }
    for (const Triangle& triangle : triangles) {
        for (const std::int32_t vertex : triangle) {
            if (vertex < 0 || vertex >= vertices.shape(0)) {
                fail<ValueError>("[rasterize] a triangle names vertex ", vertex, " of ",
                                 vertices.shape(0));
            }
        }
    }
}

template <class Paint>
[[nodiscard]] RasterImage rasterized(const Tensor& vertices, std::span<const Triangle> triangles,
                                     std::size_t channels, const Paint& paint, const Camera& camera,
                                     const RasterSettings& settings) {
    check(vertices, triangles, settings);
    const std::int64_t samples = settings.samples_per_side;
    const std::vector<Eigen::Vector3d> corners =
        projected(vertices, camera, static_cast<double>(settings.width * samples));

    const std::int64_t pixels = settings.width * settings.height;
    std::vector<float> color(channels * static_cast<std::size_t>(pixels), 0.0F);
    std::vector<float> coverage(static_cast<std::size_t>(pixels), 0.0F);
    std::vector<float> depth(static_cast<std::size_t>(pixels), nothing);
    std::vector<std::int32_t> nearest(static_cast<std::size_t>(pixels), -1);

    constexpr std::int64_t pixel_rows_at_once = 16;
    parallel_for(settings.height, pixel_rows_at_once, [&](std::int64_t begin, std::int64_t end) {
        const auto count =
            static_cast<std::size_t>((end - begin) * samples * settings.width * samples);
        SampleRows target{begin * samples,
                          (end - begin) * samples,
                          settings.width * samples,
                          channels,
                          std::vector<float>(count, nothing),
                          std::vector<float>(channels * count, 0.0F),
                          std::vector<std::int32_t>(count, -1)};
        for (std::size_t index = 0; index < triangles.size(); ++index) {
            std::array<Eigen::Vector3d, 3> points;
            for (std::size_t k = 0; k < 3; ++k)
                points[k] = corners[static_cast<std::size_t>(triangles[index][k])];
            if (std::min({points[0][2], points[1][2], points[2][2]}) < near_depth) continue;
            draw(static_cast<std::int32_t>(index), points, paint, target);
        }
        const float share = 1.0F / static_cast<float>(samples * samples);
        for (std::size_t sample = 0; sample < count; ++sample) {
            if (target.triangle[sample] < 0) continue;
            const auto row = begin + static_cast<std::int64_t>(sample) / target.columns / samples;
            const auto column = static_cast<std::int64_t>(sample) % target.columns / samples;
            const auto pixel = static_cast<std::size_t>(row * settings.width + column);
            coverage[pixel] += share;
            for (std::size_t channel = 0; channel < channels; ++channel)
                color[channels * pixel + channel] +=
                    share * target.color[channels * sample + channel];
            if (target.depth[sample] < depth[pixel]) {
                depth[pixel] = target.depth[sample];
                nearest[pixel] = target.triangle[sample];
            }
        }
    });
    const std::int64_t height = settings.height;
    const std::int64_t width = settings.width;
    return {Tensor::from({height, width, static_cast<std::int64_t>(channels)},
                         std::span<const float>(color)),
            Tensor::from({height, width, 1}, std::span<const float>(coverage)),
            Tensor::from({height, width, 1}, std::span<const float>(depth)), std::move(nearest)};
}

}  // namespace

RasterImage rasterize(const Tensor& vertices, const Tensor& colors,
                      std::span<const Triangle> triangles, const Camera& camera,
                      const RasterSettings& settings) {
    if (!(colors.shape() == vertices.shape()))
        fail<ShapeError>("[rasterize] needs vertices and colors (V, 3); got ", vertices.shape(),
                         " and ", colors.shape());
    const auto values = colors.values<float>();
    const auto paint = [&](std::int32_t index, const std::array<double, 3>& weight, double depth,
                           float* color) {
        const Triangle& corners = triangles[static_cast<std::size_t>(index)];
        for (std::size_t channel = 0; channel < 3; ++channel) {
            double value = 0.0;
            for (std::size_t k = 0; k < 3; ++k)
                value +=
                    weight[k] *
                    static_cast<double>(values[3 * static_cast<std::size_t>(corners[k]) + channel]);
            color[channel] = static_cast<float>(value * depth);
        }
        return true;
    };
    return rasterized(vertices, triangles, 3, paint, camera, settings);
}

RasterImage rasterize(const Tensor& vertices, std::span<const Triangle> triangles,
                      std::int64_t channels, const SampleColor& color, const Camera& camera,
                      const RasterSettings& settings) {
    const auto paint = [&](std::int32_t index, const std::array<double, 3>& weight, double depth,
                           float* to) {
        return color(index, {weight[0] * depth, weight[1] * depth, weight[2] * depth},
                     {to, static_cast<std::size_t>(channels)});
    };
    return rasterized(vertices, triangles, static_cast<std::size_t>(channels), paint, camera,
                      settings);
}

}  // namespace stymo
