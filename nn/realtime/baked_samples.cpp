#include "nn/realtime/baked_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <utility>

#include "core/error.h"
#include "core/ops/linalg.h"
#include "core/parallel.h"
#include "nn/engine/compositing.h"
#include "nn/engine/evaluate_points.h"
#include "nn/engine/feature_basis.h"

namespace stymo {
namespace {

// The box is found from every second ray in either direction and every second sample of the views.
constexpr std::int64_t locating_stride = 2;
// Times the tolerance: the share of the visible weight that may lie beyond each side of the box.
constexpr double share_beyond_box = 0.5;
// The spacing of the coarse grid, which covers the whole box, is halved so many times in visible
// cells.
constexpr int refinements = 2;
constexpr std::int64_t cells_unit = 1 << refinements;
constexpr std::int64_t lane_count = 16;
constexpr std::size_t basis_points = 8192;

std::int64_t rounded_up(std::int64_t value, std::int64_t unit) {
    return (value + unit - 1) / unit * unit;
}

void require_valid(const BakeOptions& options) {
    if (options.resolution < 8)
        fail<ValueError>("a baked field needs 8 cells or more along its side, got ",
                         options.resolution);
    if (options.dimension < 1)
        fail<ValueError>("a baked field needs 1 feature or more, got ", options.dimension);
    if (baked_bytes(options) > most_baked_bytes) {
        fail<ValueError>("a field baked with ", options.resolution,
                         " cells along its side may take ", baked_bytes(options) / 1'000'000,
                         " MB, more than ", most_baked_bytes / 1'000'000,
                         "; choose a lower resolution");
    }
}

/// Stores the logits at vertices of the grid in `samples`.
void evaluate_logits(const PackedField<float>& field, std::span<const std::int64_t> vertices,
                     BakedSamples& samples) {
    const auto vertex = [&](std::int64_t i) { return vertices[static_cast<std::size_t>(i)]; };
    evaluate_points(
        field, std::ssize(vertices),
        [&](std::int64_t i) { return samples.grid.position(vertex(i)); },
        [&](std::int64_t first, std::int64_t size, const FieldTile<float>& tile) {
            for (std::int64_t i = 0; i < size; ++i)
                samples.logits[static_cast<std::size_t>(vertex(first + i))] =
                    tile.logits[static_cast<std::size_t>(i)];
        });
    samples.evaluated_points += std::ssize(vertices);
}

/// Calls store(i, logit, `layer` of the features before the field's last layer) for vertices of a
/// grid, on several threads.
template <class Store>
void evaluate_features(const PackedField<float>& field, const VertexGrid& grid,
                       std::span<const std::int64_t> vertices, const FoldedLayer& layer,
                       const Store& store) {
    const PackedLayer<float> packed(layer);
    evaluate_points(
        field, std::ssize(vertices),
        [&](std::int64_t i) { return grid.position(vertices[static_cast<std::size_t>(i)]); },
        [&](std::int64_t first, std::int64_t size, FieldTile<float>& tile) {
            field.features(size, tile);
            std::vector<float> values(static_cast<std::size_t>(size * packed.outputs()));
            packed.apply(values.data(), tile.features.data(), size);
            for (std::int64_t i = 0; i < size; ++i)
                store(first + i, tile.logits[static_cast<std::size_t>(i)],
                      values.data() + i * packed.outputs());
        });
}

void evaluate_whole_grid(const PackedField<float>& field, const VertexGrid& grid,
                         BakedSamples& samples) {
    samples.grid = grid;
    samples.logits.resize(static_cast<std::size_t>(grid.size()));
    std::vector<std::int64_t> vertices(samples.logits.size());
    std::iota(vertices.begin(), vertices.end(), std::int64_t{0});
    evaluate_logits(field, vertices, samples);
}

std::vector<std::uint8_t> marks(const BakedSamples& samples, double step, double tolerance) {
    std::vector<float> density(samples.logits.size());
    std::ranges::transform(samples.logits, density.begin(), softplus);
    return significant_vertices(samples.grid, density, std::max(step, samples.grid.spacing),
                                tolerance);
}

struct WeightedPoint {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    double weight = 0.0;
};

/// The samples of the outermost views with their compositing weights.
std::vector<WeightedPoint> seen_points(const PackedField<float>& field, RaySampling rays,
                                       const ViewRange& views) {
    rays.rays_per_side = std::max<std::int64_t>(rays.rays_per_side / locating_stride, 1);
    rays.samples_per_ray = std::max<std::int64_t>(rays.samples_per_ray / locating_stride, 2);
    const RaySamples samples = sample_rays(cameras_over(views, 3, 3), rays, nullptr);
    const auto points = samples.points.values<float>();
    const auto deltas = samples.deltas.values<float>();
    std::vector<WeightedPoint> seen(deltas.size());
    evaluate_points(
        field, std::ssize(seen),
        [&](std::int64_t i) { return points.subspan(static_cast<std::size_t>(3 * i), 3); },
        [&](std::int64_t first, std::int64_t size, const FieldTile<float>& tile) {
            for (std::int64_t i = first; i < first + size; ++i) {
                const float* point = points.data() + 3 * i;
                // Holds the optical depth until the rays are composited, then the weight.
                seen[static_cast<std::size_t>(i)] = {
                    {static_cast<double>(point[0]), static_cast<double>(point[1]),
                     static_cast<double>(point[2])},
                    static_cast<double>(
                        density_of_logit(tile.logits[static_cast<std::size_t>(i - first)]) *
                        deltas[static_cast<std::size_t>(i)])};
            }
        });
    Transmittance<double> light;
    for (std::size_t i = 0; i < seen.size(); ++i) {
        if (i % static_cast<std::size_t>(rays.samples_per_ray) == 0) light = {};
        seen[i].weight = light.pass(seen[i].weight);
    }
    return seen;
}

/// The box beyond each side of which lies at most `share` of the total weight, enlarged by
/// `margin`.
Box box_of(std::vector<WeightedPoint> points, double share, double margin) {
    double total = 0.0;
    for (const WeightedPoint& point : points) total += point.weight;
    Box box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        std::ranges::sort(points, {},
                          [axis](const WeightedPoint& point) { return point.position[axis]; });
        const auto reach = [&](auto first, auto last) {
            double passed = first->weight;
            while (passed <= share * total && first + 1 != last) passed += (++first)->weight;
            return first->position[axis];
        };
        box.lower[axis] = reach(points.begin(), points.end()) - margin;
        box.upper[axis] = reach(points.rbegin(), points.rend()) + margin;
    }
    return box;
}

/// Computes the density on the finest grid, except at the returned vertices, which must still be
/// evaluated.
std::vector<std::int64_t> sample_density(const PackedField<float>& field, const Box& box,
                                         double step, const BakeOptions& options,
                                         BakedSamples& samples) {
    evaluate_whole_grid(field, cover(box, rounded_up(options.resolution, cells_unit) / cells_unit),
                        samples);
    std::vector<std::int64_t> vertices;
    for (int level = 0; level < refinements; ++level) {
        evaluate_logits(field, vertices, samples);
        vertices = vertices_to_refine(samples.grid, marks(samples, step, options.tolerance));
        samples.logits = prolonged(samples.grid, samples.logits);
        samples.grid = refined(samples.grid);
    }
    return vertices;
}

/// Principal components of the features at some vertices, weighted by the opacity of a sample
/// there.
FeatureBasis find_basis(const PackedField<float>& packed, const FoldedField& field,
                        const VertexGrid& grid, std::span<const std::int64_t> vertices, double step,
                        std::int64_t dimension) {
    // An odd stride avoids picking the same columns of every row if rows have an even number of
    // vertices.
    const std::size_t stride = std::max<std::size_t>(vertices.size() / basis_points, 1) | 1U;
    std::vector<std::int64_t> some;
    for (std::size_t i = 0; i < vertices.size(); i += stride) some.push_back(vertices[i]);
    const auto count = static_cast<std::int64_t>(some.size());
    const std::int64_t channels = field.feature1.weight.shape(0);
    Tensor features({count, channels}), weights({count});
    float* feature = features.mutable_values<float>().data();
    float* weight = weights.mutable_values<float>().data();
    evaluate_features(packed, grid, some, field.feature1,
                      [&](std::int64_t i, float logit, const float* values) {
                          weight[i] = -std::expm1(-static_cast<float>(step) * softplus(logit));
                          std::copy_n(values, channels, feature + i * channels);
                      });
    return principal_plane(features, weights, std::min(dimension, channels));
}

/// From features before the field's last layer, r, to coefficients: directions (W r + b - mean),
/// with zeros up to `dimension`.
FoldedLayer coefficients_layer(const FeatureBasis& basis, const FoldedLayer& last,
                               std::int64_t dimension) {
    const std::int64_t channels = last.weight.shape(0), width = last.weight.shape(1);
    const auto times_directions = [&](const Tensor& matrix) {
        return matmul(basis.directions, matrix.reshaped({channels, matrix.size() / channels}))
            .value();
    };
    Tensor offset({channels});
    std::ranges::transform(last.bias.values<float>(), basis.mean.values<float>(),
                           offset.mutable_values<float>().begin(), std::minus<>());
    FoldedLayer layer{Tensor::zeros({dimension, width}), Tensor::zeros({dimension}),
                      Activation::none};
    std::ranges::copy(times_directions(last.weight).values<float>(),
                      layer.weight.mutable_values<float>().begin());
    std::ranges::copy(times_directions(offset).values<float>(),
                      layer.bias.mutable_values<float>().begin());
    return layer;
}

Tensor finishing_matrix(const FeatureBasis& basis, std::int64_t dimension) {
    const std::int64_t channels = basis.mean.size();
    Tensor finish = Tensor::zeros({dimension + 1, channels});
    const auto values = finish.mutable_values<float>();
    std::ranges::copy(basis.directions.values<float>(), values.begin());
    std::ranges::copy(basis.mean.values<float>(), values.end() - channels);
    return finish;
}

}  // namespace

std::int64_t baked_bytes(const BakeOptions& options) {
    const std::int64_t side = rounded_up(options.resolution, cells_unit) + 1;
    const auto record = rounded_up(options.dimension, lane_count) *
                        static_cast<std::int64_t>(sizeof(kernels::BFloat16));
    const auto vertex = static_cast<std::int64_t>(sizeof(float) + sizeof(std::int32_t)) + record;
    return side * side * side * vertex + record;
}

std::int64_t BakedSamples::bytes() const {
    return static_cast<std::int64_t>(logits.size() * sizeof(float) +
                                     record_of.size() * sizeof(std::int32_t) +
                                     records.size() * sizeof(kernels::BFloat16));
}

BakedSamples bake(const FoldedField& field, const RaySampling& rays, const ViewRange& views,
                  const BakeOptions& options) {
    require_valid(options);
    const PackedField<float> packed(field);
    BakedSamples samples;
    samples.dimension = rounded_up(options.dimension, lane_count);
    const double step = (rays.near_z - rays.far_z) / static_cast<double>(rays.samples_per_ray);
    std::vector<WeightedPoint> seen = seen_points(packed, rays, views);
    samples.evaluated_points = static_cast<std::int64_t>(seen.size());
    std::erase_if(
        seen, [&](const WeightedPoint& point) { return point.weight < 0.1 * options.tolerance; });
    const auto margin = static_cast<double>(locating_stride) * step;
    const Box box = seen.empty()
                        ? Box{{-margin, -margin, -margin}, {margin, margin, margin}}
                        : box_of(std::move(seen), share_beyond_box * options.tolerance, margin);
    const std::vector<std::int64_t> vertices = sample_density(packed, box, step, options, samples);

    samples.record_of.assign(samples.logits.size(), 0);
    samples.records.assign((vertices.size() + 1) * static_cast<std::size_t>(samples.dimension),
                           kernels::BFloat16{});
    samples.finish = Tensor::zeros({samples.dimension + 1, field.feature1.weight.shape(0)});
    if (vertices.empty()) return samples;
    const FeatureBasis basis =
        find_basis(packed, field, samples.grid, vertices, step, samples.dimension);
    samples.finish = finishing_matrix(basis, samples.dimension);
    evaluate_features(packed, samples.grid, vertices,
                      coefficients_layer(basis, field.feature1, samples.dimension),
                      [&](std::int64_t i, float logit, const float* coefficients) {
                          const auto vertex =
                              static_cast<std::size_t>(vertices[static_cast<std::size_t>(i)]);
                          samples.logits[vertex] = logit;
                          samples.record_of[vertex] = static_cast<std::int32_t>(i + 1);
                          std::transform(coefficients, coefficients + samples.dimension,
                                         samples.records.begin() + (i + 1) * samples.dimension,
                                         kernels::rounded_to_bfloat16);
                      });
    samples.evaluated_points += static_cast<std::int64_t>(vertices.size());
    return samples;
}

}  // namespace stymo
