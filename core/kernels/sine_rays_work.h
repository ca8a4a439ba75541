#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/kernels/sine_rays.h"
#include "core/parallel.h"

/// How the kernels of core/kernels/sine_rays.cpp cut their work.
namespace stymo::kernels::sine_rays_work {

/// Points of a tile: as many as leave the arguments of all sines and one layer's weights in the second-level cache.
inline constexpr std::int64_t tile_points = 128;
/// Rays of one face are cut into so many runs at most; each has sums of its own, which are added in order.
inline constexpr std::int64_t runs = 16;
/// As in render/composite.cpp.
inline constexpr double largest_density = 1e30;

/// What a layer's input consists of.
struct LayerInput {
    std::int64_t encoding;  ///< 0 or the encoding's channels, which come first
    std::int64_t before;    ///< 0 or the channels of the layer before
};

struct Extents {
    std::int64_t faces, rays, samples, width, encoding, frequencies;
    std::vector<LayerInput> inputs;

    Extents(const RayPoints& rays_and_points, const SineNetworkOf<Tensor>& network)
        : faces(rays_and_points.deltas.shape(0)),
          rays(rays_and_points.deltas.shape(1)),
          samples(rays_and_points.deltas.shape(2)),
          width(network.density_weight.shape(1)),
          encoding(3 + 6 * network.frequencies),
          frequencies(network.frequencies) {
        for (std::size_t i = 0; i < network.layers.size(); ++i)
            inputs.push_back({i == 0 || i == network.skip_layer ? encoding : 0, i == 0 ? 0 : width});
    }

    [[nodiscard]] std::int64_t rays_in_run() const { return chunk_count(rays, runs); }
    [[nodiscard]] std::int64_t columns() const { return samples + 1 + width; }
    /// Of a layer's kept arguments, those of a tile whose first ray this is.
    [[nodiscard]] std::int64_t kept_offset(std::size_t layer, std::int64_t ray) const {
        return (static_cast<std::int64_t>(layer) * rays + ray) * samples * width;
    }
    [[nodiscard]] std::int64_t kept_numbers() const { return std::ssize(inputs) * rays * samples * width; }
    /// Points of the largest tile; a ray is never cut.
    [[nodiscard]] std::int64_t largest_tile() const { return std::max(tile_points, samples); }
};

}  // namespace stymo::kernels::sine_rays_work
