#include "nn/models/realtime/baked_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <utility>

#include "core/error.h"
#include "core/kernels/matmul.h"
#include "core/parallel.h"
#include "nn/models/realtime/feature_basis.h"
#include "nn/models/realtime/packed_field.h"
#include "nn/models/realtime/softplus.h"

namespace stymo {
namespace {

// The views are first looked at with every second ray in either direction and every second sample.
constexpr std::int64_t locating_stride = 2;
// Of the tolerance: the share of what the views see that may lie beyond each side of the box.
constexpr double share_beyond_box = 0.5;
// From the lattice that covers the box as a whole, spacings are halved so many times where it shows.
constexpr int refinements = 2;
constexpr std::int64_t cells_unit = 1 << refinements;
constexpr std::int64_t lane_count = 16;
constexpr std::size_t basis_points = 8192;
constexpr std::int64_t points_per_tile = 256;

std::int64_t rounded_up(std::int64_t value, std::int64_t unit) {
    return (value + unit - 1) / unit * unit;
}

void require_valid(const BakeOptions& options) {
    if (options.resolution < 8) fail<ValueError>("a baked field needs 8 cells or more along its side, got ", options.resolution);
    if (options.dimension < 1) fail<ValueError>("a baked field needs 1 feature or more, got ", options.dimension);
    if (baked_bytes(options) > most_baked_bytes) {
        fail<ValueError>("a field baked with ", options.resolution, " cells along its side may take ",
                         baked_bytes(options) / 1'000'000, " MB, more than ", most_baked_bytes / 1'000'000,
                         "; choose a lower resolution");
    }
}

/// What is evaluated beside the density, and where it goes: `layer` on the features before the field's last layer.
struct Projection {
    kernels::PackedMatrix<float> weight;
    std::vector<float> bias;

    explicit Projection(const FoldedLayer& layer)
        : weight(layer.weight.values<float>().data(), layer.weight.shape(1), layer.weight.shape(0), 1, layer.weight.shape(1)),
          bias(layer.bias.values<float>().begin(), layer.bias.values<float>().end()) {}
};

/// Calls store(i, density, projected features or null) for `count` points place(i), on several threads.
template <class Place, class Store>
void evaluate(const PackedField<float>& field, std::int64_t count, Place place, const Projection* projection, Store store) {
    constexpr std::int64_t points_per_chunk = 8 * points_per_tile;
    parallel_for(count, points_per_chunk, [&](std::int64_t chunk_begin, std::int64_t chunk_end) {
        FieldTile<float> tile;
        std::vector<float> points, projected;
        std::vector<std::int32_t> rows(points_per_tile);
        std::iota(rows.begin(), rows.end(), 0);
        for (std::int64_t begin = chunk_begin; begin < chunk_end; begin += points_per_tile) {
            const std::int64_t end = std::min(begin + points_per_tile, chunk_end), size = end - begin;
            points.clear();
            for (std::int64_t i = begin; i < end; ++i) {
                for (const double coordinate : place(i)) points.push_back(static_cast<float>(coordinate));
            }
            field.density(points, tile);
            std::int64_t channels = 0;
            if (projection != nullptr) {
                channels = projection->weight.columns();
                projected.resize(static_cast<std::size_t>(size * channels));
                field.features(std::span(rows).first(static_cast<std::size_t>(size)), tile);
                kernels::multiply_packed<float>(projected.data(), channels, {tile.features.data(), field.width()}, size,
                                                projection->weight, {.bias = projection->bias.data()});
            }
            for (std::int64_t i = 0; i < size; ++i) {
                store(begin + i, tile.density[static_cast<std::size_t>(i)], projected.data() + i * channels);
            }
        }
    });
}

/// The same for vertices of a lattice.
template <class Store>
void evaluate_vertices(const PackedField<float>& field, const Lattice& lattice, std::span<const std::int64_t> vertices,
                       const Projection* projection, Store store) {
    const auto place = [&](std::int64_t i) { return lattice.position(vertices[static_cast<std::size_t>(i)]); };
    evaluate(field, static_cast<std::int64_t>(vertices.size()), place, projection, store);
}

void evaluate_density(const PackedField<float>& field, std::span<const std::int64_t> vertices, BakedSamples& samples) {
    evaluate_vertices(field, samples.lattice, vertices, nullptr, [&](std::int64_t i, float density, const float*) {
        const std::int64_t vertex = vertices[static_cast<std::size_t>(i)];
        samples.density_inputs[static_cast<std::size_t>(vertex)] = inverse_softplus(density);
    });
    samples.evaluated_points += static_cast<std::int64_t>(vertices.size());
}

void evaluate_whole_lattice(const PackedField<float>& field, const Lattice& lattice, BakedSamples& samples) {
    samples.lattice = lattice;
    samples.density_inputs.resize(static_cast<std::size_t>(lattice.size()));
    std::vector<std::int64_t> vertices(samples.density_inputs.size());
    std::iota(vertices.begin(), vertices.end(), std::int64_t{0});
    evaluate_density(field, vertices, samples);
}

std::vector<std::uint8_t> marks(const BakedSamples& samples, double step, double tolerance) {
    std::vector<float> density(samples.density_inputs.size());
    std::ranges::transform(samples.density_inputs, density.begin(), softplus);
    return significant_vertices(samples.lattice, density, std::max(step, samples.lattice.spacing), tolerance);
}

struct WeightedPoint {
    Vector3 place{};
    double weight = 0.0;
};

/// Where the samples of the outermost views lie, with their compositing weights.
std::vector<WeightedPoint> seen_points(const PackedField<float>& field, RaySampling rays, const ViewRange& views) {
    rays.rays_per_side = std::max<std::int64_t>(rays.rays_per_side / locating_stride, 1);
    rays.samples_per_ray = std::max<std::int64_t>(rays.samples_per_ray / locating_stride, 2);
    const RaySamples samples = sample_rays(cameras_over(views, 3, 3), rays, nullptr);
    const auto points = samples.points.values<float>();
    const auto deltas = samples.deltas.values<float>();
    std::vector<WeightedPoint> seen(deltas.size());
    const auto place = [&](std::int64_t i) {
        const float* point = points.data() + 3 * i;
        return Vector3{static_cast<double>(point[0]), static_cast<double>(point[1]), static_cast<double>(point[2])};
    };
    evaluate(field, static_cast<std::int64_t>(seen.size()), place, nullptr, [&](std::int64_t i, float density, const float*) {
        const double optical_depth = static_cast<double>(density) * static_cast<double>(deltas[static_cast<std::size_t>(i)]);
        seen[static_cast<std::size_t>(i)] = {place(i), -std::expm1(-optical_depth)};
    });
    double transmittance = 1.0;
    for (std::size_t i = 0; i < seen.size(); ++i) {
        if (i % static_cast<std::size_t>(rays.samples_per_ray) == 0) transmittance = 1.0;
        seen[i].weight *= transmittance;
        transmittance -= seen[i].weight;
    }
    return seen;
}

/// The box beyond each side of which lies at most this share of all weight, and `margin` more.
Box box_of(std::vector<WeightedPoint> points, double share, double margin) {
    double total = 0.0;
    for (const WeightedPoint& point : points) total += point.weight;
    Box box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        std::ranges::sort(points, {}, [axis](const WeightedPoint& point) { return point.place[axis]; });
        const auto reach = [&](auto first, auto last) {
            double passed = first->weight;
            while (passed <= share * total && first + 1 != last) passed += (++first)->weight;
            return first->place[axis];
        };
        box.lower[axis] = reach(points.begin(), points.end()) - margin;
        box.upper[axis] = reach(points.rbegin(), points.rend()) + margin;
    }
    return box;
}

/// Leaves the density on the finest lattice but for the vertices returned, which are still to be evaluated.
std::vector<std::int64_t> sample_density(const PackedField<float>& field, const Box& box, double step, const BakeOptions& options,
                                         BakedSamples& samples) {
    evaluate_whole_lattice(field, cover(box, rounded_up(options.resolution, cells_unit) / cells_unit), samples);
    std::vector<std::int64_t> vertices;
    for (int level = 0; level < refinements; ++level) {
        evaluate_density(field, vertices, samples);
        vertices = vertices_to_refine(samples.lattice, marks(samples, step, options.tolerance));
        samples.density_inputs = prolonged(samples.lattice, samples.density_inputs);
        samples.lattice = refined(samples.lattice);
    }
    return vertices;
}

/// The plane of the features of some of the vertices, each as much as a sample of the field there counts.
FeatureBasis find_basis(const PackedField<float>& packed, const FoldedField& field, const Lattice& lattice,
                        std::span<const std::int64_t> vertices, double step, std::int64_t dimension) {
    // An odd stride does not stay in step with rows of an even number of vertices.
    const std::size_t stride = std::max<std::size_t>(vertices.size() / basis_points, 1) | 1U;
    std::vector<std::int64_t> some;
    for (std::size_t i = 0; i < vertices.size(); i += stride) some.push_back(vertices[i]);
    const auto count = static_cast<std::int64_t>(some.size());
    const std::int64_t channels = field.feature1.weight.shape(0);
    Tensor features({count, channels}), weights({count});
    float* feature = features.mutable_values<float>().data();
    float* weight = weights.mutable_values<float>().data();
    const Projection all(field.feature1);
    evaluate_vertices(packed, lattice, some, &all, [&](std::int64_t i, float density, const float* values) {
        weight[i] = -std::expm1(-static_cast<float>(step) * density);
        std::copy_n(values, channels, feature + i * channels);
    });
    return principal_plane(features, weights, std::min(dimension, channels));
}

/// From features before the field's last layer, r, to coefficients: directions (W r + b - mean), with zeros up to `dimension`.
FoldedLayer coefficients_layer(const FeatureBasis& basis, const FoldedLayer& last, std::int64_t dimension) {
    const std::int64_t kept = basis.directions.shape(0), channels = last.weight.shape(0), width = last.weight.shape(1);
    const auto times_directions = [&](const Tensor& matrix) {
        const Tensor directions = basis.directions.reshaped({1, kept, channels});
        return kernels::matmul(directions, matrix.reshaped({1, channels, matrix.size() / channels}), {});
    };
    Tensor offset({channels});
    std::ranges::transform(last.bias.values<float>(), basis.mean.values<float>(), offset.mutable_values<float>().begin(),
                           std::minus<>());
    FoldedLayer layer{Tensor::zeros({dimension, width}), Tensor::zeros({dimension}), Activation::none};
    std::ranges::copy(times_directions(last.weight).values<float>(), layer.weight.mutable_values<float>().begin());
    std::ranges::copy(times_directions(offset).values<float>(), layer.bias.mutable_values<float>().begin());
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
    const auto record = rounded_up(options.dimension, lane_count) * static_cast<std::int64_t>(sizeof(kernels::BFloat16));
    const auto vertex = static_cast<std::int64_t>(sizeof(float) + sizeof(std::int32_t)) + record;
    return side * side * side * vertex + record;
}

std::int64_t BakedSamples::bytes() const {
    return static_cast<std::int64_t>(density_inputs.size() * sizeof(float) + record_of.size() * sizeof(std::int32_t) +
                                     records.size() * sizeof(kernels::BFloat16));
}

BakedSamples bake(const FoldedField& field, const RaySampling& rays, const ViewRange& views, const BakeOptions& options) {
    require_valid(options);
    const PackedField<float> packed(field);
    BakedSamples samples;
    samples.dimension = rounded_up(options.dimension, lane_count);
    const double step = (rays.near_z - rays.far_z) / static_cast<double>(rays.samples_per_ray);
    std::vector<WeightedPoint> seen = seen_points(packed, rays, views);
    samples.evaluated_points = static_cast<std::int64_t>(seen.size());
    std::erase_if(seen, [&](const WeightedPoint& point) { return point.weight < 0.1 * options.tolerance; });
    const auto margin = static_cast<double>(locating_stride) * step;
    const Box box = seen.empty() ? Box{{-margin, -margin, -margin}, {margin, margin, margin}}
                                 : box_of(std::move(seen), share_beyond_box * options.tolerance, margin);
    const std::vector<std::int64_t> vertices = sample_density(packed, box, step, options, samples);

    samples.record_of.assign(samples.density_inputs.size(), 0);
    samples.records.assign((vertices.size() + 1) * static_cast<std::size_t>(samples.dimension), kernels::BFloat16{});
    samples.finish = Tensor::zeros({samples.dimension + 1, field.feature1.weight.shape(0)});
    if (vertices.empty()) return samples;
    const FeatureBasis basis = find_basis(packed, field, samples.lattice, vertices, step, samples.dimension);
    samples.finish = finishing_matrix(basis, samples.dimension);
    const Projection projection(coefficients_layer(basis, field.feature1, samples.dimension));
    evaluate_vertices(packed, samples.lattice, vertices, &projection,
                      [&](std::int64_t i, float density, const float* coefficients) {
                          const auto vertex = static_cast<std::size_t>(vertices[static_cast<std::size_t>(i)]);
                          samples.density_inputs[vertex] = inverse_softplus(density);
                          samples.record_of[vertex] = static_cast<std::int32_t>(i + 1);
                          std::transform(coefficients, coefficients + samples.dimension,
                                         samples.records.begin() + (i + 1) * samples.dimension, kernels::rounded_to_bfloat16);
                      });
    samples.evaluated_points += static_cast<std::int64_t>(vertices.size());
    return samples;
}

}  // namespace stymo
