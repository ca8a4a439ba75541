#include "nn/models/realtime/baked_field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "core/error.h"
#include "core/kernels/matmul.h"
#include "core/ops/shape_ops.h"
#include "core/parallel.h"
#include "nn/models/realtime/feature_basis.h"
#include "render/encoding.h"

namespace stymo {
namespace {

constexpr std::int64_t locating_cells = 32;
constexpr std::int64_t block_cells = 4;
constexpr std::int64_t lane_count = 16;
constexpr std::int64_t basis_points = 8192;
// What is left of the light when a ray stops.
constexpr float least_transmittance = 1e-4F;
constexpr float least_weight = 1e-5F;

std::int64_t rounded_up(std::int64_t value, std::int64_t unit) {
    return (value + unit - 1) / unit * unit;
}

float density_of(float input) {
    const float x = input - 1.0F;
    return std::max(x, 0.0F) + std::log1p(std::exp(-std::abs(x)));
}

std::vector<float> densities(const std::vector<float>& inputs) {
    std::vector<float> result(inputs.size());
    std::ranges::transform(inputs, result.begin(), density_of);
    return result;
}

std::uint16_t upper_half(float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    return static_cast<std::uint16_t>((bits + 0x7FFFU + ((bits >> 16) & 1U)) >> 16);
}
float from_upper_half(std::uint16_t half) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(half) << 16);
}

Box sampled_box(const RaySampling& rays) {
    const double reach = std::max(std::abs(rays.near_z), std::abs(rays.far_z));
    Box box{{-reach, -reach, -reach}, {reach, reach, reach}};
    if (rays.planes == DepthPlanes::world_z) {
        box.lower[2] = rays.far_z;
        box.upper[2] = rays.near_z;
    }
    return box;
}

Tensor apply(const FoldedLayer& layer, const Tensor& x) {
    const Tensor weight = layer.weight.reshaped({1, layer.weight.shape(0), layer.weight.shape(1)});
    return kernels::linear(x, weight, layer.bias, layer.activation, false).value;
}

struct FieldValues {
    Tensor density_input;  ///< (P)
    Tensor features;       ///< (P, rows of the last layer)
};

FieldValues evaluate(const FoldedField& field, const Lattice& lattice, std::span<const std::int64_t> vertices,
                     const FoldedLayer* last) {
    const auto count = static_cast<std::int64_t>(vertices.size());
    Tensor points({1, count, 3});
    float* values = points.mutable_values<float>().data();
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const Vector3 position = lattice.position(vertices[i]);
        for (std::size_t axis = 0; axis < 3; ++axis) values[3 * i + axis] = static_cast<float>(position[axis]);
    }
    const Variable encoding = positional_encoding(points, field.frequencies);
    Tensor x = encoding.value();
    for (std::size_t i = 0; i < field.layers.size(); ++i) {
        x = apply(field.layers[i], i > 0 && i == field.skip_layer ? concat({encoding, x}, 2).value() : x);
    }
    FieldValues result{apply(field.density, x).reshaped({count}), {}};
    if (last != nullptr) result.features = apply(*last, apply(field.feature0, x)).reshaped({count, last->weight.shape(0)});
    return result;
}

template <class Store>
void evaluate_all(const FoldedField& field, const Lattice& lattice, std::span<const std::int64_t> vertices,
                  const FoldedLayer* last, Store store) {
    constexpr std::size_t tile = 16384;
    for (std::size_t begin = 0; begin < vertices.size(); begin += tile) {
        const auto part = vertices.subspan(begin, std::min(tile, vertices.size() - begin));
        store(begin, evaluate(field, lattice, part, last));
    }
}

std::vector<std::int64_t> all_vertices(const Lattice& lattice) {
    std::vector<std::int64_t> result(static_cast<std::size_t>(lattice.size()));
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = static_cast<std::int64_t>(i);
    return result;
}

void evaluate_density(const FoldedField& field, const Lattice& lattice, std::span<const std::int64_t> vertices,
                      std::vector<float>& density_input) {
    evaluate_all(field, lattice, vertices, nullptr, [&](std::size_t begin, const FieldValues& values) {
        const auto inputs = values.density_input.values<float>();
        for (std::size_t i = 0; i < inputs.size(); ++i) density_input[static_cast<std::size_t>(vertices[begin + i])] = inputs[i];
    });
}

}  // namespace

std::int64_t baked_bytes(const BakeOptions& options) {
    const std::int64_t side = rounded_up(options.resolution, 4) + 1;
    const std::int64_t record = rounded_up(options.dimension, lane_count) * 2;
    const std::int64_t blocks = side / block_cells + 1;
    return side * side * side * (4 + 4 + record) + record + blocks * blocks * blocks;
}

std::int64_t BakedField::bytes() const {
    return static_cast<std::int64_t>(4 * density_input_.size() + 4 * record_of_.size() + 2 * records_.size() +
                                     block_is_empty_.size());
}

BakedField::BakedField(const FoldedField& field, const RaySampling& rays, const BakeOptions& options)
    : dimension_(rounded_up(options.dimension, lane_count)) {
    if (options.resolution < 8) fail<ValueError>("a baked field needs at least 8 cells along its side, got ", options.resolution);
    if (baked_bytes(options) > most_baked_bytes) {
        fail<ValueError>("a field baked with ", options.resolution, " cells along its side may take ", baked_bytes(options) / 1000000,
                         " MB, more than ", most_baked_bytes / 1000000, "; choose a lower resolution");
    }
    const double step = (rays.near_z - rays.far_z) / static_cast<double>(rays.samples_per_ray);
    const auto significant = [&](const Lattice& lattice, const std::vector<float>& density_input) {
        return significant_vertices(lattice, densities(density_input), std::max(step, lattice.spacing), options.tolerance);
    };
    const auto evaluate_whole = [&](const Lattice& lattice) {
        std::vector<float> density_input(static_cast<std::size_t>(lattice.size()));
        evaluate_density(field, lattice, all_vertices(lattice), density_input);
        evaluated_points_ += lattice.size();
        return density_input;
    };
    lattice_ = cover(sampled_box(rays), locating_cells);
    density_input_ = evaluate_whole(lattice_);
    const Box box = marked_box(lattice_, significant(lattice_, density_input_));
    std::vector<std::int64_t> vertices;
    if (box.lower != box.upper) {
        lattice_ = cover(box, rounded_up(options.resolution, 4) / 4);
        density_input_ = evaluate_whole(lattice_);
        for (int level = 0; level < 2; ++level) {
            vertices = vertices_to_refine(lattice_, significant(lattice_, density_input_));
            density_input_ = prolonged(lattice_, density_input_);
            lattice_ = refined(lattice_);
            evaluated_points_ += static_cast<std::int64_t>(vertices.size());
            if (level == 0) evaluate_density(field, lattice_, vertices, density_input_);
        }
    }

    const std::int64_t channels = field.feature1.weight.shape(0), width = field.feature1.weight.shape(1);
    const std::int64_t kept = std::min(dimension_, channels);
    // Spread over the list by a stride that shares no factor with a lattice's rows.
    std::vector<std::int64_t> few;
    const std::size_t stride = std::max<std::size_t>(vertices.size() / basis_points, 1) | 1U;
    for (std::size_t i = 0; i < vertices.size(); i += stride) few.push_back(vertices[i]);
    if (few.empty()) few.push_back(0);
    const FieldValues some = evaluate(field, lattice_, few, &field.feature1);
    Tensor weights({static_cast<std::int64_t>(few.size())});
    for (std::size_t i = 0; i < few.size(); ++i) {
        weights.mutable_values<float>()[i] =
            -std::expm1(-static_cast<float>(step) * density_of(some.density_input.values<float>()[i]));
    }
    const FeatureBasis basis = principal_plane(some.features, weights, kept);

    // directions (W r + b - mean), padded with zeros to whole lanes
    FoldedLayer last{Tensor::zeros({dimension_, width}), Tensor::zeros({dimension_}), Activation::none};
    const Tensor product =
        kernels::matmul(basis.directions.reshaped({1, kept, channels}), field.feature1.weight.reshaped({1, channels, width}), {});
    std::ranges::copy(product.values<float>(), last.weight.mutable_values<float>().begin());
    finish_ = Tensor::zeros({channels, dimension_ + 1});
    {
        const auto directions = basis.directions.values<float>();
        const auto mean = basis.mean.values<float>();
        const auto bias = field.feature1.bias.values<float>();
        const auto finish = finish_.mutable_values<float>();
        const auto offset = last.bias.mutable_values<float>();
        for (std::size_t c = 0; c < static_cast<std::size_t>(channels); ++c) {
            for (std::size_t k = 0; k < static_cast<std::size_t>(kept); ++k) {
                const float direction = directions[k * static_cast<std::size_t>(channels) + c];
                finish[c * static_cast<std::size_t>(dimension_ + 1) + k] = direction;
                offset[k] += direction * (bias[c] - mean[c]);
            }
            finish[c * static_cast<std::size_t>(dimension_ + 1) + static_cast<std::size_t>(dimension_)] = mean[c];
        }
    }

    record_of_.assign(density_input_.size(), 0);
    records_.assign((vertices.size() + 1) * static_cast<std::size_t>(dimension_), 0);
    evaluate_all(field, lattice_, vertices, &last, [&](std::size_t begin, const FieldValues& values) {
        const auto inputs = values.density_input.values<float>();
        const auto features = values.features.values<float>();
        for (std::size_t i = 0; i < inputs.size(); ++i) {
            const auto vertex = static_cast<std::size_t>(vertices[begin + i]);
            density_input_[vertex] = inputs[i];
            record_of_[vertex] = static_cast<std::int32_t>(begin + i + 1);
        }
        std::ranges::transform(features, records_.begin() + static_cast<std::ptrdiff_t>(begin + 1) * dimension_, upper_half);
    });
    mark_occupied_blocks(1e-3 / (rays.near_z - rays.far_z));
}

void BakedField::mark_occupied_blocks(double least_density) {
    for (std::size_t axis = 0; axis < 3; ++axis) blocks_[axis] = (lattice_.vertices[axis] - 1 + block_cells - 1) / block_cells;
    block_is_empty_.assign(static_cast<std::size_t>(blocks_[0] * blocks_[1] * blocks_[2]), 1);
    const auto last = [&](std::size_t axis, std::int64_t block) {
        return std::min((block + 1) * block_cells, lattice_.vertices[axis] - 1);
    };
    std::size_t block = 0;
    for (std::int64_t z = 0; z < blocks_[2]; ++z) {
        for (std::int64_t y = 0; y < blocks_[1]; ++y) {
            for (std::int64_t x = 0; x < blocks_[0]; ++x, ++block) {
                float largest = density_input_[static_cast<std::size_t>(lattice_.index(x * block_cells, y * block_cells, z * block_cells))];
                for (std::int64_t k = z * block_cells; k <= last(2, z); ++k) {
                    for (std::int64_t j = y * block_cells; j <= last(1, y); ++j) {
                        for (std::int64_t i = x * block_cells; i <= last(0, x); ++i)
                            largest = std::max(largest, density_input_[static_cast<std::size_t>(lattice_.index(i, j, k))]);
                    }
                }
                if (static_cast<double>(density_of(largest)) > least_density) block_is_empty_[block] = 0;
            }
        }
    }
}

RayFeatures BakedField::operator()(const RaySamples& samples) const {
    const std::int64_t rays = samples.deltas.shape(1), count = samples.deltas.shape(2);
    Tensor coefficients({1, rays, dimension_ + 1});
    RayFeatures result{{}, Tensor({rays}), Tensor({rays})};
    const float* points = samples.points.values<float>().data();
    const float* deltas = samples.deltas.values<float>().data();
    const float* depths = samples.depths.values<float>().data();
    float* rows = coefficients.mutable_values<float>().data();
    float* opacity = result.opacity.mutable_values<float>().data();
    float* depth = result.depth.mutable_values<float>().data();
    constexpr std::int64_t rays_per_chunk = 16;
    parallel_for(rays, rays_per_chunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t ray = begin; ray < end; ++ray) {
            float* row = rows + ray * (dimension_ + 1);
            march(points + ray * count * 3, deltas + ray * count, depths + ray * count, count, row, depth + ray);
            opacity[ray] = row[dimension_];
        }
    });
    const Tensor weight = finish_.reshaped({1, finish_.shape(0), finish_.shape(1)});
    result.features = kernels::linear(coefficients, weight, {}, Activation::none, false).value.reshaped({rays, finish_.shape(0)});
    return result;
}

void BakedField::march(const float* points, const float* deltas, const float* depths, std::int64_t count, float* coefficients,
                       float* depth) const {
    std::fill_n(coefficients, dimension_ + 1, 0.0F);
    const float scale = static_cast<float>(1.0 / lattice_.spacing);
    std::array<float, 3> offset{}, limit{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        offset[axis] = static_cast<float>(lattice_.origin[axis] / lattice_.spacing);
        limit[axis] = static_cast<float>(lattice_.vertices[axis] - 1);
    }
    const std::int64_t down = lattice_.vertices[0], up = lattice_.vertices[0] * lattice_.vertices[1];
    float transmittance = 1.0F;
    *depth = 0.0F;
    for (std::int64_t k = 0; k < count; ++k) {
        std::array<float, 3> place{};
        std::array<std::int64_t, 3> cell{};
        bool inside = true;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            place[axis] = points[3 * k + static_cast<std::int64_t>(axis)] * scale - offset[axis];
            inside &= place[axis] >= 0.0F && place[axis] < limit[axis];
        }
        if (!inside) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) cell[axis] = static_cast<std::int64_t>(place[axis]);
        const std::int64_t block =
            (cell[2] / block_cells * blocks_[1] + cell[1] / block_cells) * blocks_[0] + cell[0] / block_cells;
        if (block_is_empty_[static_cast<std::size_t>(block)] != 0) continue;
        const float fx = place[0] - static_cast<float>(cell[0]), fy = place[1] - static_cast<float>(cell[1]),
                    fz = place[2] - static_cast<float>(cell[2]);
        const float* corner = density_input_.data() + lattice_.index(cell[0], cell[1], cell[2]);
        const auto along_x = [fx](const float* first) { return first[0] + fx * (first[1] - first[0]); };
        const float front = along_x(corner) + fy * (along_x(corner + down) - along_x(corner));
        const float back = along_x(corner + up) + fy * (along_x(corner + up + down) - along_x(corner + up));
        const float optical_depth = density_of(front + fz * (back - front)) * deltas[k];
        const float weight = -std::expm1(-optical_depth) * transmittance;
        if (weight > least_weight) {
            gather(place, weight, coefficients);
            coefficients[dimension_] += weight;
            *depth += weight * depths[k];
        }
        transmittance -= weight;
        if (transmittance < least_transmittance) break;
    }
    *depth += transmittance * depths[count - 1];
}

void BakedField::gather(const std::array<float, 3>& place, float weight, float* coefficients) const {
    std::array<std::int64_t, 3> cell{};
    std::array<std::array<float, 2>, 3> share{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        cell[axis] = static_cast<std::int64_t>(place[axis]);
        const float fraction = place[axis] - static_cast<float>(cell[axis]);
        share[axis] = {1.0F - fraction, fraction};
    }
    const std::int32_t* first = record_of_.data() + lattice_.index(cell[0], cell[1], cell[2]);
    std::array<const std::uint16_t*, 8> record{};
    std::array<float, 8> factor{};
    for (std::size_t corner = 0; corner < 8; ++corner) {
        const std::size_t x = corner & 1, y = (corner >> 1) & 1, z = corner >> 2;
        const std::int32_t index = first[lattice_.index(static_cast<std::int64_t>(x), static_cast<std::int64_t>(y),
                                                        static_cast<std::int64_t>(z))];
        record[corner] = records_.data() + index * dimension_;
        factor[corner] = weight * share[0][x] * share[1][y] * share[2][z];
    }
    for (std::int64_t begin = 0; begin < dimension_; begin += lane_count) {
        float* out = coefficients + begin;
#pragma omp simd
        for (std::int64_t c = 0; c < lane_count; ++c) {
            float sum = out[c];
            for (std::size_t corner = 0; corner < 8; ++corner) sum += factor[corner] * from_upper_half(record[corner][begin + c]);
            out[c] = sum;
        }
    }
}

}  // namespace stymo
