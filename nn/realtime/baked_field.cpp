#include "nn/realtime/baked_field.h"

#include <algorithm>
#include <cmath>

#include "core/ops/shape_ops.h"
#include "core/parallel.h"
#include "nn/engine/compositing.h"

namespace stymo {
namespace {

// Cells along each side of a block that is skipped if it is empty.
constexpr std::int64_t block_cells = 4;
constexpr std::int64_t lane_count = 16;
constexpr std::int64_t rays_per_chunk = 32;
// In units of the tolerance: largest weight of a ray's samples in blocks that count as empty, and
// of samples behind the last one that is read.
constexpr double neglected_share = 0.1;
// In units of the tolerance: largest opacity of a ray that counts as empty.
constexpr double empty_share = 10.0;

}  // namespace

BakedField::BakedField(const RaySampling& rays, const ViewRange& views, const BakeOptions& options)
    : sampling_(rays), views_(views), options_(options) {}

void BakedField::set_field(const FoldedField& field) {
    samples_ = bake(field, sampling_, views_, options_);
    last_layer_ = PackedLayer<float>(
        {transpose(samples_.finish).value(), Tensor::zeros({samples_.finish.shape(1)})});
    mark_empty_blocks();
}

void BakedField::mark_empty_blocks() {
    const VertexGrid& grid = samples_.grid;
    for (std::size_t axis = 0; axis < 3; ++axis)
        blocks_[axis] = (grid.vertices[axis] - 2) / block_cells + 1;
    block_is_empty_.resize(static_cast<std::size_t>(blocks_[0] * blocks_[1] * blocks_[2]));
    const double least_density =
        neglected_share * options_.tolerance / (sampling_.near_z - sampling_.far_z);
    const float least_logit = inverse_softplus(static_cast<float>(least_density));
    parallel_for(blocks_[2], 1, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t block = begin * blocks_[0] * blocks_[1];
             block < end * blocks_[0] * blocks_[1]; ++block) {
            const std::array<std::int64_t, 3> coordinates{block % blocks_[0],
                                                          block / blocks_[0] % blocks_[1],
                                                          block / (blocks_[0] * blocks_[1])};
            std::array<std::int64_t, 3> first{}, last{};
            for (std::size_t axis = 0; axis < 3; ++axis) {
                first[axis] = coordinates[axis] * block_cells;
                last[axis] = std::min(first[axis] + block_cells, grid.vertices[axis] - 1);
            }
            bool empty = true;
            for (std::int64_t z = first[2]; z <= last[2]; ++z) {
                for (std::int64_t y = first[1]; y <= last[1]; ++y) {
                    const float* row = samples_.logits.data() + grid.index(0, y, z);
                    empty =
                        empty && *std::max_element(row + first[0], row + last[0] + 1) < least_logit;
                }
            }
            block_is_empty_[static_cast<std::size_t>(block)] = empty ? 1 : 0;
        }
    });
}

void BakedField::render(const CameraRays& rays, FeatureMap& map, const std::stop_token& /*stop*/) {
    const auto count = static_cast<std::int64_t>(rays.rays.size());
    const std::int64_t row_size = samples_.dimension + 1, channels = last_layer_.outputs();
    map.features.resize(static_cast<std::size_t>(count * channels));
    map.occupied.resize(rays.rays.size());
    map.opacities.resize(rays.rays.size());
    map.depths.resize(rays.rays.size());
    map.field_samples = map.significant_samples = map.tiles = 0;
    coefficients_.resize(static_cast<std::size_t>(count * row_size));
    const auto background = static_cast<float>(farthest_sample(rays));
    parallel_for(count, rays_per_chunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const auto ray = static_cast<std::size_t>(i);
            const std::span row = std::span(coefficients_)
                                      .subspan(ray * static_cast<std::size_t>(row_size),
                                               static_cast<std::size_t>(row_size));
            std::ranges::fill(row, 0.0F);
            const Marched seen =
                march(rays.rays[ray], rays.samples_per_ray, row.first(row.size() - 1));
            map.depths[ray] = seen.depth + (1.0F - seen.opacity) * background;
            map.occupied[ray] =
                static_cast<double>(seen.opacity) > empty_share * options_.tolerance ? 1 : 0;
            map.opacities[ray] = map.occupied[ray] != 0 ? seen.opacity : 0.0F;
            if (map.occupied[ray] != 0) {
                row.back() = seen.opacity;
            } else {
                std::ranges::fill(row, 0.0F);
            }
        }
        last_layer_.apply(map.features.data() + begin * channels,
                          coefficients_.data() + begin * row_size, end - begin);
    });
}

BakedField::Marched BakedField::march(const Ray& ray, std::int64_t samples_per_ray,
                                      std::span<float> coefficients) const {
    const VertexGrid& grid = samples_.grid;
    const double delta =
        sample_distance(ray, 1, samples_per_ray) - sample_distance(ray, 0, samples_per_ray);
    // Positions are in cells from the first vertex; sample k is at start + k step.
    std::array<float, 3> start{}, step{}, limit{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double first = ray.origin[axis] + ray.near_distance * ray.direction[axis];
        start[axis] = static_cast<float>((first - grid.origin[axis]) / grid.spacing);
        step[axis] = static_cast<float>(delta * ray.direction[axis] / grid.spacing);
        limit[axis] = static_cast<float>(grid.vertices[axis] - 1);
    }
    const std::int64_t down = grid.index(0, 1, 0), back = grid.index(0, 0, 1);
    const auto least_transmittance = static_cast<float>(neglected_share * options_.tolerance);
    // Samples of smaller weight have the mean feature.
    const float least_weight = least_transmittance;
    Marched seen;
    Transmittance<float> light;
    for (std::int64_t k = 0; k < samples_per_ray && light.value() > least_transmittance; ++k) {
        std::array<float, 3> position{}, fraction{};
        std::array<std::int64_t, 3> cell{};
        bool inside = true;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            position[axis] = start[axis] + static_cast<float>(k) * step[axis];
            inside = inside && position[axis] >= 0.0F && position[axis] < limit[axis];
        }
        if (!inside) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            cell[axis] = static_cast<std::int64_t>(position[axis]);
            fraction[axis] = position[axis] - static_cast<float>(cell[axis]);
        }
        const std::int64_t block =
            (cell[2] / block_cells * blocks_[1] + cell[1] / block_cells) * blocks_[0] +
            cell[0] / block_cells;
        if (block_is_empty_[static_cast<std::size_t>(block)] != 0) continue;
        const float* corner = samples_.logits.data() + grid.index(cell[0], cell[1], cell[2]);
        const auto between = [](float a, float b, float share) { return a + share * (b - a); };
        const auto on_face = [&](const float* face) {
            return between(between(face[0], face[1], fraction[0]),
                           between(face[down], face[down + 1], fraction[0]), fraction[1]);
        };
        const float optical_depth =
            softplus(between(on_face(corner), on_face(corner + back), fraction[2])) *
            static_cast<float>(delta);
        const float weight = light.pass(optical_depth);
        if (weight > least_weight) add_features(position, weight, coefficients);
        seen.opacity += weight;
        seen.depth += weight * static_cast<float>(sample_distance(ray, k, samples_per_ray));
    }
    return seen;
}

void BakedField::add_features(const std::array<float, 3>& position, float weight,
                              std::span<float> coefficients) const {
    std::array<std::int64_t, 3> cell{};
    std::array<std::array<float, 2>, 3> share{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        cell[axis] = static_cast<std::int64_t>(position[axis]);
        const float fraction = position[axis] - static_cast<float>(cell[axis]);
        share[axis] = {1.0F - fraction, fraction};
    }
    const VertexGrid& grid = samples_.grid;
    const std::int32_t* first = samples_.record_of.data() + grid.index(cell[0], cell[1], cell[2]);
    std::array<const kernels::BFloat16*, 8> record{};
    std::array<float, 8> factor{};
    for (std::size_t corner = 0; corner < 8; ++corner) {
        const std::size_t x = corner & 1U, y = (corner >> 1U) & 1U, z = corner >> 2U;
        const std::int32_t index =
            first[grid.index(static_cast<std::int64_t>(x), static_cast<std::int64_t>(y),
                             static_cast<std::int64_t>(z))];
        record[corner] = samples_.records.data() + index * samples_.dimension;
        factor[corner] = weight * share[0][x] * share[1][y] * share[2][z];
    }
    for (std::int64_t begin = 0; begin < samples_.dimension; begin += lane_count) {
        float* out = coefficients.data() + begin;
#pragma omp simd
        for (std::int64_t lane = 0; lane < lane_count; ++lane) {
            float sum = out[lane];
            for (std::size_t corner = 0; corner < 8; ++corner)
                sum += factor[corner] * kernels::widened(record[corner][begin + lane]);
            out[lane] = sum;
        }
    }
}

}  // namespace stymo
