#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/kernels/fast_math.h"
#include "core/kernels/gemm.h"
#include "core/ops/sine_rays.h"
#include "core/parallel.h"

/// What both passes of core/kernels/sine_rays.h do with the rays of one face, tile by tile.
namespace stymo::kernels {

/// Points of a tile: as many as leave the arguments of all sines and one layer's weights in the second-level cache.
inline constexpr std::int64_t tile_points = 128;
/// Rays of one face are cut into so many runs at most; each has sums of its own, which are added in order.
inline constexpr std::int64_t ray_runs = 16;
/// As in render/composite.cpp.
inline constexpr double largest_density = 1e30;

/// What a layer's input consists of.
struct LayerInput {
    std::int64_t encoding;  ///< 0 or the encoding's channels, which come first
    std::int64_t before;    ///< 0 or the channels of the layer before
};

struct RayExtents {
    std::int64_t faces, rays, samples, width, encoding, frequencies;
    std::vector<LayerInput> inputs;

    RayExtents(const RayPoints& rays_and_points, const SineNetworkOf<Tensor>& network)
        : faces(rays_and_points.deltas.shape(0)),
          rays(rays_and_points.deltas.shape(1)),
          samples(rays_and_points.deltas.shape(2)),
          width(network.density_weight.shape(1)),
          encoding(3 + 6 * network.frequencies),
          frequencies(network.frequencies) {
        for (std::size_t i = 0; i < network.layers.size(); ++i)
            inputs.push_back({i == 0 || i == network.skip_layer ? encoding : 0, i == 0 ? 0 : width});
    }

    [[nodiscard]] std::int64_t rays_in_run() const { return chunk_count(rays, ray_runs); }
    [[nodiscard]] std::int64_t columns() const { return samples + 1 + width; }
    /// Of a layer's kept arguments, those of a tile whose first ray this is.
    [[nodiscard]] std::int64_t kept_offset(std::size_t layer, std::int64_t ray) const {
        return (static_cast<std::int64_t>(layer) * rays + ray) * samples * width;
    }
    [[nodiscard]] std::int64_t kept_numbers() const { return std::ssize(inputs) * rays * samples * width; }
    /// Points of the largest tile; a ray is never cut.
    [[nodiscard]] std::int64_t largest_tile() const { return std::max(tile_points, samples); }
};

/// One face's layer: W'_oi = demodulation_o W_oi scale_i for the way there, demodulation_o W_oi for the way back.
template <class T>
struct PackedLayer {
    PackedMatrix<T> encoding, before;
    PackedMatrix<T> encoding_back, before_back;
    const T* weight;
    const T* scale;
    const T* demodulation;
    const T* bias;
};

template <class T>
struct PackedFace {
    std::vector<PackedLayer<T>> layers;
    const T* density_weight;
    T density_bias;
};

template <class T>
PackedLayer<T> pack(const ModulatedLayerOf<Tensor>& layer, const LayerInput& input, std::int64_t face, bool way_back) {
    const std::int64_t out = layer.bias.shape(0), in = input.encoding + input.before;
    PackedLayer<T> packed{{},
                          {},
                          {},
                          {},
                          layer.weight.values<T>().data(),
                          layer.scale.values<T>().data() + face * in,
                          layer.demodulation.values<T>().data() + face * out,
                          layer.bias.values<T>().data()};
    std::vector<T> there(static_cast<std::size_t>(out * in)), back(there.size());
    for (std::int64_t o = 0; o < out; ++o) {
        for (std::int64_t i = 0; i < in; ++i) {
            const auto at = static_cast<std::size_t>(o * in + i);
            back[at] = packed.demodulation[o] * packed.weight[at];
            there[at] = back[at] * packed.scale[i];
        }
    }
    const std::int64_t first = input.encoding;
    if (first > 0) packed.encoding = PackedMatrix<T>(there.data(), first, out, 1, in);
    if (input.before > 0) packed.before = PackedMatrix<T>(there.data() + first, input.before, out, 1, in);
    if (way_back && first > 0) packed.encoding_back = PackedMatrix<T>(back.data(), out, first, in, 1);
    if (way_back && input.before > 0) packed.before_back = PackedMatrix<T>(back.data() + first, out, input.before, in, 1);
    return packed;
}

template <class T>
PackedFace<T> pack(const SineNetworkOf<Tensor>& network, const RayExtents& extents, std::int64_t face, bool way_back) {
    PackedFace<T> packed{{}, network.density_weight.values<T>().data(), network.density_bias.values<T>()[0]};
    for (std::size_t i = 0; i < network.layers.size(); ++i)
        packed.layers.push_back(pack<T>(network.layers[i], extents.inputs[i], face, way_back));
    return packed;
}

/// Whole rays and their samples that are kept.
template <class T>
struct RayTile {
    std::int64_t first_ray = 0, end_ray = 0;
    std::vector<std::int64_t> samples;  ///< index of each point among the face's samples
    std::vector<std::int64_t> begins;   ///< of each ray's points, and their end
    std::vector<T> logits;
    std::vector<T> weights;
    std::vector<T> transmittances;  ///< of each ray, before every point and behind the last; ray i begins at begins[i] + i

    [[nodiscard]] std::int64_t points() const { return static_cast<std::int64_t>(samples.size()); }
    [[nodiscard]] std::int64_t begin_of(std::int64_t ray) const { return begins[static_cast<std::size_t>(ray - first_ray)]; }
    [[nodiscard]] std::int64_t end_of(std::int64_t ray) const { return begins[static_cast<std::size_t>(ray - first_ray + 1)]; }
};

template <class T>
std::unique_ptr<T[]> scratch(std::int64_t count) {
    return std::make_unique_for_overwrite<T[]>(static_cast<std::size_t>(count));
}

/// The rays of one face that one thread works on, tile by tile.
template <class T>
class RayRun {
public:
    RayRun(const RayPoints& rays, const PackedFace<T>& packed, const RayExtents& extents, std::int64_t face)
        : face_(packed),
          extents_(extents),
          points_(rays.points.values<T>().data() + face * extents.rays * extents.samples * 3),
          deltas_(rays.deltas.values<T>().data() + face * extents.rays * extents.samples),
          kept_(rays.kept.defined() ? rays.kept.values<T>().data() + face * extents.rays * extents.samples : nullptr),
          encoding_(scratch<T>(extents.largest_tile() * encoding_stride())) {}

    /// The next rays from `first` that fill a tile.
    void take(std::int64_t first, std::int64_t end) {
        tile_.first_ray = first;
        tile_.samples.clear();
        tile_.begins.assign(1, 0);
        std::int64_t ray = first;
        for (; ray < end && (ray == first || tile_.points() + extents_.samples <= extents_.largest_tile()); ++ray) {
            for (std::int64_t sample = ray * extents_.samples; sample < (ray + 1) * extents_.samples; ++sample)
                if (kept_ == nullptr || kept_[sample] != T(0)) tile_.samples.push_back(sample);
            tile_.begins.push_back(tile_.points());
        }
        tile_.end_ray = ray;
        encode();
    }

    /// bias + W' input, or its sine.
    void multiply(std::size_t layer, const T* before, T* result, Activation activation) const {
        const PackedLayer<T>& packed = face_.layers[layer];
        const LayerInput& input = extents_.inputs[layer];
        const std::int64_t width = extents_.width;
        if (input.encoding > 0) {
            multiply_packed(result, width, LeftMatrix<T>{encoding_.get(), encoding_stride()}, tile_.points(), packed.encoding,
                            Epilogue<T>{.bias = packed.bias, .activation = input.before > 0 ? Activation::none : activation});
        }
        if (input.before > 0) {
            Epilogue<T> epilogue{.activation = activation};
            if (input.encoding > 0) {
                epilogue.present_values = true;
            } else {
                epilogue.bias = packed.bias;
            }
            multiply_packed(result, width, LeftMatrix<T>{before, width}, tile_.points(), packed.before, epilogue);
        }
    }

    /// Logits, weights and transmittances from the last layer before the features.
    void composite(const T* last) {
        const std::int64_t width = extents_.width;
        const auto count = static_cast<std::size_t>(tile_.points());
        tile_.logits.resize(count);
        tile_.weights.resize(count);
        tile_.transmittances.resize(count + tile_.begins.size());
        for (std::int64_t ray = tile_.first_ray; ray < tile_.end_ray; ++ray) {
            double depth = 0.0;
            T* behind = transmittances(ray);
            *behind = T(1);
            for (std::int64_t point = tile_.begin_of(ray); point < tile_.end_of(ray); ++point) {
                T logit = T(0);
                const T* x = last + point * width;
#pragma omp simd reduction(+ : logit)
                for (std::int64_t i = 0; i < width; ++i) logit += x[i] * face_.density_weight[i];
                logit += face_.density_bias - T(1);
                const auto at = static_cast<std::size_t>(point);
                const T thickness = density(logit) * deltas_[tile_.samples[at]];
                depth += static_cast<double>(thickness);
                const T before = *behind;
                *++behind = static_cast<T>(std::exp(-depth));
                tile_.logits[at] = logit;
                tile_.weights[at] = (before + *behind) * std::tanh(thickness * T(0.5));
            }
        }
    }

    [[nodiscard]] T* transmittances(std::int64_t ray) {
        return tile_.transmittances.data() + tile_.begin_of(ray) + (ray - tile_.first_ray);
    }
    [[nodiscard]] const RayTile<T>& tile() const {
        return tile_;
    }
    [[nodiscard]] const T* encoding() const {
        return encoding_.get();
    }
    [[nodiscard]] std::int64_t encoding_stride() const {
        return (extents_.encoding + 15) / 16 * 16;
    }
    [[nodiscard]] T delta(std::int64_t sample) const {
        return deltas_[sample];
    }

    /// softplus, within what compositing takes.
    static T density(T logit) {
        return std::min(std::max(logit, T(0)) + std::log1p(std::exp(-std::abs(logit))), static_cast<T>(largest_density));
    }

private:
    void encode() {
        const std::int64_t frequencies = extents_.frequencies;
        std::array<T, 3 * 64> phases, sines, cosines;
        for (std::int64_t point = 0; point < tile_.points(); ++point) {
            const T* x = points_ + 3 * tile_.samples[static_cast<std::size_t>(point)];
            T* to = encoding_.get() + point * encoding_stride();
            std::copy_n(x, 3, to);
            T frequency = T(1);
            for (std::int64_t k = 0; k < frequencies; ++k, frequency *= T(2))
                for (std::int64_t axis = 0; axis < 3; ++axis)
                    phases[static_cast<std::size_t>(3 * k + axis)] = x[axis] * frequency;
            for_each_sine_cosine(phases.data(), 3 * frequencies, [&](std::int64_t i, T sine, T cosine) {
                sines[static_cast<std::size_t>(i)] = sine, cosines[static_cast<std::size_t>(i)] = cosine;
            });
            for (std::int64_t k = 0; k < frequencies; ++k) {
                std::copy_n(sines.data() + 3 * k, 3, to + 3 + 6 * k);
                std::copy_n(cosines.data() + 3 * k, 3, to + 6 + 6 * k);
            }
        }
    }

    const PackedFace<T>& face_;
    const RayExtents& extents_;
    const T* points_;
    const T* deltas_;
    const T* kept_;
    std::unique_ptr<T[]> encoding_;
    RayTile<T> tile_;
};

/// Calls body(face, first ray, end ray, run) for all runs of one face.
template <class Body>
void for_each_run(const RayExtents& extents, const Body& body) {
    const std::int64_t length = extents.rays_in_run();
    parallel_for(extents.rays, length, [&](std::int64_t first, std::int64_t end) { body(first, end, first / length); });
}

template <class T>
void take_sines(const T* x, T* y, std::int64_t count) {
    for_each_sine_cosine(x, count, [=](std::int64_t i, T sine, T) { y[i] = sine; });
}

}  // namespace stymo::kernels
