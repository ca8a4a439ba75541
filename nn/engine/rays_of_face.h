#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "nn/engine/ray_tile.h"
#include "nn/engine/sine_network.h"

/// The forward and the backward pass of nn/engine/render_field.h, and the code that they share.
namespace stymo {

struct FieldPassResult {
    /// (B, R, N + 1 + width): weights, transmittance behind the last sample, composited features.
    Tensor value;
    /// Arguments of the sines, (B, layers, R * N, width); undefined unless they were asked for. The
    /// selected samples of a tile are stored in consecutive rows, from the row of the tile's first
    /// ray on.
    Tensor arguments;
};

/// The forward pass. The op checks the shapes. Keeping arguments does not change the value.
[[nodiscard]] FieldPassResult render_field_forward(const RayPoints& rays,
                                                   const SineNetworkOf<Tensor>& network,
                                                   bool keep_arguments);

/// Gradients of all parts of the network, each in the shape of its part. The gradients of the
/// layers' weights stay undefined unless `with_weights`. Sine arguments are computed again if
/// `forward` has none. With a gradient_tolerance above 0, `forward` must have no arguments but must
/// have its value, whose weights decide which samples get a gradient. The result does not depend on
/// the number of threads.
[[nodiscard]] SineNetworkOf<Tensor> render_field_backward(const RayPoints& rays,
                                                          const SineNetworkOf<Tensor>& network,
                                                          const FieldPassResult& forward,
                                                          const Tensor& dL_dy, bool with_weights);

/// Largest number of runs into which the rays of one face are divided. Each run has its own sums,
/// which are added in order, so that results do not depend on the number of threads.
inline constexpr std::int64_t ray_runs = 16;

struct RayExtents {
    std::int64_t faces, rays, samples, width, layers;

    RayExtents(const RayPoints& points, const SineNetworkOf<Tensor>& network)
        : faces(points.deltas.shape(0)),
          rays(points.deltas.shape(1)),
          samples(points.deltas.shape(2)),
          width(network.density_weight.shape(1)),
          layers(std::ssize(network.layers)) {}

    [[nodiscard]] std::int64_t rays_in_run() const { return chunk_count(rays, ray_runs); }
    /// Columns of the result for each ray: N weights, the transmittance, the composited features.
    [[nodiscard]] std::int64_t columns() const { return samples + 1 + width; }
    /// Largest number of points in a tile, which holds at least one ray.
    [[nodiscard]] std::int64_t largest_tile() const { return std::max(tile_points, samples); }
    /// Number of sine arguments of one layer for one face.
    [[nodiscard]] std::int64_t layer_arguments() const { return rays * samples * width; }
    [[nodiscard]] std::int64_t face_arguments() const { return layers * layer_arguments(); }
};

/// The samples of the rays of one face.
template <class T>
struct FaceSamples {
    const T* points;
    const T* deltas;
    std::int64_t samples_per_ray;
    SampleSelection selection;

    FaceSamples(const RayPoints& rays, const RayExtents& extents, std::int64_t face)
        : points(rays.points.values<T>().data() + face * extents.rays * extents.samples * 3),
          deltas(rays.deltas.values<T>().data() + face * extents.rays * extents.samples),
          samples_per_ray(extents.samples) {
        selection.resize(extents.rays, extents.samples);
        if (!rays.significant.defined()) {
            selection.keep_all();
            return;
        }
        const T* const kept =
            rays.significant.values<T>().data() + face * extents.rays * extents.samples;
        selection.keep_if([=](std::int64_t ray, std::int32_t sample) {
            return kept[ray * extents.samples + sample] != T(0);
        });
    }

    /// Leaves out samples whose compositing weight is below the tolerance. Row r of `weights` holds
    /// the weights of ray r; rows are `stride` elements apart. The optical depth of samples left
    /// out is kept in `gaps` and `tails`.
    void keep_heavy(const T* weights, std::int64_t stride, T tolerance) {
        selection.keep_if([=](std::int64_t ray, std::int32_t sample) {
            return weights[ray * stride + sample] >= tolerance;
        });
        for (std::size_t ray = 0; ray < selection.counts.size(); ++ray)
            fill_gaps(static_cast<std::int64_t>(ray),
                      weights + static_cast<std::int64_t>(ray) * stride);
    }

    void append(std::int64_t ray, std::int32_t sample, std::vector<T>& to) const {
        const T* const point = points + 3 * (ray * samples_per_ray + sample);
        to.insert(to.end(), point, point + 3);
    }
    [[nodiscard]] T length(std::int64_t ray, std::int32_t sample) const {
        return deltas[ray * samples_per_ray + sample];
    }

private:
    /// Computes the optical depths of the samples left out of a ray from its compositing weights.
    void fill_gaps(std::int64_t ray, const T* weights) {
        const std::span<const std::int32_t> selected = selection.samples_of(ray);
        float* const gaps = selection.gaps.data() + ray * samples_per_ray;
        double transmittance = 1.0, gap = 0.0;
        std::size_t next = 0;
        for (std::int32_t sample = 0; sample < samples_per_ray; ++sample) {
            const double behind = transmittance - static_cast<double>(weights[sample]);
            if (next < selected.size() && selected[next] == sample) {
                gaps[next++] = static_cast<float>(gap);
                gap = 0.0;
            } else if (behind > 0.0) {
                gap += std::log(transmittance / behind);
            }
            transmittance = behind;
        }
        selection.tails[static_cast<std::size_t>(ray)] = static_cast<float>(gap);
    }
};

/// Calls body(first ray, end ray, index of the run) for all runs of one face, on several threads.
template <class Body>
void for_each_run(const RayExtents& extents, const Body& body) {
    const std::int64_t length = extents.rays_in_run();
    parallel_for(extents.rays, length,
                 [&](std::int64_t first, std::int64_t end) { body(first, end, first / length); });
}

/// Divides rays [first, end) into tiles, and calls body() each time `tile` has been filled with one
/// of them. A tile takes as many whole rays as fit, so that matrix products stay large even if few
/// samples are selected.
template <class T, class Body>
void for_each_tile(const FaceSamples<T>& samples, const RayExtents& extents, std::int64_t first,
                   std::int64_t end, RayTile<T>& tile, const Body& body) {
    const auto count = [&](std::int64_t ray) {
        return samples.selection.counts[static_cast<std::size_t>(ray)];
    };
    while (first < end) {
        std::int64_t stop = first + 1;
        std::int64_t points = count(first);
        while (stop < end && points + count(stop) <= extents.largest_tile())
            points += count(stop++);
        tile.take(samples.selection, samples, first, stop);
        body();
        first = stop;
    }
}

}  // namespace stymo
