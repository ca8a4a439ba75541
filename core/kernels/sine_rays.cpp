#include "core/kernels/sine_rays.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "core/kernels/fast_math.h"
#include "core/kernels/gemm.h"
#include "core/kernels/sine_rays_work.h"
#include "core/parallel.h"

namespace stymo::kernels {

namespace {

using namespace sine_rays_work;

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
struct Face {
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
Face<T> pack(const SineNetworkOf<Tensor>& network, const Extents& extents, std::int64_t face, bool way_back) {
    Face<T> packed{{}, network.density_weight.values<T>().data(), network.density_bias.values<T>()[0]};
    for (std::size_t i = 0; i < network.layers.size(); ++i)
        packed.layers.push_back(pack<T>(network.layers[i], extents.inputs[i], face, way_back));
    return packed;
}

/// Whole rays and their samples that are kept.
template <class T>
struct Tile {
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
    RayRun(const RayPoints& rays, const Face<T>& packed, const Extents& extents, std::int64_t face)
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
    [[nodiscard]] const Tile<T>& tile() const {
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

    const Face<T>& face_;
    const Extents& extents_;
    const T* points_;
    const T* deltas_;
    const T* kept_;
    std::unique_ptr<T[]> encoding_;
    Tile<T> tile_;
};

/// Calls body(face, first ray, end ray, run) for all runs of one face.
template <class Body>
void for_each_run(const Extents& extents, const Body& body) {
    const std::int64_t length = extents.rays_in_run();
    parallel_for(extents.rays, length, [&](std::int64_t first, std::int64_t end) { body(first, end, first / length); });
}

template <class T>
void take_sines(const T* x, T* y, std::int64_t count) {
    for_each_sine_cosine(x, count, [=](std::int64_t i, T sine, T) { y[i] = sine; });
}

/// `arguments`: the face's, null where they are not kept.
template <class T>
void render_run(RayRun<T>& run, const Extents& extents, std::int64_t first, std::int64_t end, T* arguments, T* result) {
    const std::int64_t width = extents.width;
    const auto even = scratch<T>(extents.largest_tile() * width), odd = scratch<T>(extents.largest_tile() * width);
    const std::size_t features = extents.inputs.size() - 1;
    for (std::int64_t ray = first; ray < end; ray = run.tile().end_ray) {
        run.take(ray, end);
        T* x = odd.get();
        for (std::size_t layer = 0; layer <= features; ++layer) {
            const T* before = x;
            if (layer == features) run.composite(before);
            x = layer % 2 == 0 ? even.get() : odd.get();
            if (arguments == nullptr) {
                run.multiply(layer, before, x, Activation::sine);
                continue;
            }
            T* const z = arguments + extents.kept_offset(layer, ray);
            run.multiply(layer, before, z, Activation::none);
            take_sines(z, x, run.tile().points() * width);
        }
        const Tile<T>& tile = run.tile();
        for (std::int64_t at = tile.first_ray; at < tile.end_ray; ++at) {
            T* row = result + at * extents.columns();
            std::fill_n(row, extents.columns(), T(0));
            T* composited = row + extents.samples + 1;
            for (std::int64_t point = tile.begin_of(at); point < tile.end_of(at); ++point) {
                const T weight = tile.weights[static_cast<std::size_t>(point)];
                row[tile.samples[static_cast<std::size_t>(point)] - at * extents.samples] = weight;
                for (std::int64_t i = 0; i < width; ++i) composited[i] += weight * x[point * width + i];
            }
            row[extents.samples] = run.transmittances(at)[tile.end_of(at) - tile.begin_of(at)];
        }
    }
}

/// Sums of one run or of all: with g the gradient of a layer's argument, of column i of its input x_i (W_oi demodulation_o g_o),
/// of row o g_o (argument_o - bias_o), of the bias g_o, and of W' g_o x_i.
template <class T>
struct LayerSums {
    std::vector<T> columns, rows, bias, weight;
};

template <class T>
struct NetworkSums {
    std::vector<LayerSums<T>> layers;
    std::vector<T> density_weight;
    T density_bias = T(0);

    NetworkSums(const Extents& extents, bool with_weights) : density_weight(static_cast<std::size_t>(extents.width)) {
        const auto out = static_cast<std::size_t>(extents.width);
        for (const LayerInput& input : extents.inputs) {
            const auto in = static_cast<std::size_t>(input.encoding + input.before);
            layers.push_back({std::vector<T>(in), std::vector<T>(out), std::vector<T>(out),
                              std::vector<T>(with_weights ? out * in : std::size_t{0})});
        }
    }
};

template <class T>
void add_to(std::vector<T>& sums, const std::vector<T>& more) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += more[i];
}

/// The backward pass of one run.
template <class T>
class GradientRun {
public:
    /// `kept`: the face's arguments, null where they are to be computed.
    GradientRun(RayRun<T>& run, const Face<T>& face, const Extents& extents, NetworkSums<T>& sums, const T* kept,
                bool with_weights)
        : run_(run),
          face_(face),
          extents_(extents),
          sums_(sums),
          kept_(kept),
          with_weights_(with_weights),
          size_(extents.largest_tile() * extents.width),
          layers_(extents.inputs.size()),
          computed_(scratch<T>(kept == nullptr ? size_ * std::ssize(extents.inputs) : 0)),
          buffers_(scratch<T>(3 * size_)),
          activation_(buffers_.get()),
          gradient_(activation_ + size_),
          behind_(gradient_ + size_),
          encoding_gradient_(scratch<T>(extents.largest_tile() * run.encoding_stride())) {}

    void operator()(std::int64_t first, std::int64_t end, const T* dL_dy) {
        for (std::int64_t ray = first; ray < end; ray = run_.tile().end_ray) {
            run_.take(ray, end);
            take_arguments();
            differentiate_compositing(dL_dy);
            for (std::size_t layer = layers_ - 1; layer > 0; --layer) {
                go_behind(layer, layer + 1 == layers_);
                std::swap(gradient_, behind_);
            }
            add_encoding(0);
        }
    }

private:
    [[nodiscard]] const T* arguments(std::size_t layer) const {
        return kept_ == nullptr ? computed_.get() + static_cast<std::int64_t>(layer) * size_
                                : kept_ + extents_.kept_offset(layer, run_.tile().first_ray);
    }

    /// Of all layers, and what compositing makes of them.
    void take_arguments() {
        const std::int64_t count = run_.tile().points() * extents_.width;
        for (std::size_t layer = 0; layer < layers_; ++layer) {
            if (layer + 1 == layers_) run_.composite(activation_);
            if (kept_ == nullptr) {
                run_.multiply(layer, activation_, computed_.get() + static_cast<std::int64_t>(layer) * size_, Activation::none);
            }
            // Arguments that are kept are read for their own sake later.
            if (layer + 2 == layers_ || (kept_ == nullptr && layer + 1 < layers_))
                take_sines(arguments(layer), activation_, count);
        }
    }

    /// From the result's gradient to that of the features' argument, and to that of the logits.
    void differentiate_compositing(const T* dL_dy) {
        const Tile<T>& tile = run_.tile();
        const std::int64_t width = extents_.width;
        dL_dlogit_.resize(tile.samples.size());
        dL_dweight_.resize(tile.samples.size());
        LayerSums<T>& sums = sums_.layers.back();
        const T* const bias = face_.layers.back().bias;
        T* const rows = sums.rows.data();
        T* const biases = sums.bias.data();
        for (std::int64_t ray = tile.first_ray; ray < tile.end_ray; ++ray) {
            const T* row = dL_dy + ray * extents_.columns();
            const T* dL_dfeature = row + extents_.samples + 1;
            for (std::int64_t point = tile.begin_of(ray); point < tile.end_of(ray); ++point) {
                const auto at = static_cast<std::size_t>(point);
                const T weight = tile.weights[at];
                const T* z = arguments(layers_ - 1) + point * width;
                T* g = gradient_ + point * width;
                T* feature = activation_ + point * width;
                for_each_argument(z, [=](std::int64_t i, T sine, T cosine) {
                    feature[i] = sine;
                    g[i] = weight * dL_dfeature[i] * cosine;
                    rows[i] += g[i] * (z[i] - bias[i]);
                    biases[i] += g[i];
                });
                T product = T(0);
#pragma omp simd reduction(+ : product)
                for (std::int64_t i = 0; i < width; ++i) product += dL_dfeature[i] * feature[i];
                dL_dweight_[at] = product + row[tile.samples[at] - ray * extents_.samples];
            }
            differentiate_weights(ray, row[extents_.samples]);
        }
    }

    template <class Store>
    void for_each_argument(const T* z, Store store) const {
        for_each_sine_cosine(z, extents_.width, store);
    }

    /// With w_i = t_i - t_{i+1} and t_{i+1} = t_i exp(-x_i), dL/dx_k = t_{k+1} dL/dw_k - sum_{i>k} w_i dL/dw_i - t_N dL/dt_N.
    void differentiate_weights(std::int64_t ray, T dL_dtransmittance) {
        const Tile<T>& tile = run_.tile();
        const std::int64_t begin = tile.begin_of(ray), end = tile.end_of(ray);
        const T* transmittances = run_.transmittances(ray);
        double behind = static_cast<double>(transmittances[end - begin]) * static_cast<double>(dL_dtransmittance);
        for (std::int64_t point = end - 1; point >= begin; --point) {
            const auto at = static_cast<std::size_t>(point);
            const T dL_dthickness = transmittances[point - begin + 1] * dL_dweight_[at] - static_cast<T>(behind);
            behind += static_cast<double>(tile.weights[at]) * static_cast<double>(dL_dweight_[at]);
            const T logit = tile.logits[at];
            const bool within = RayRun<T>::density(logit) < static_cast<T>(largest_density);
            const T slope = within ? T(1) / (T(1) + std::exp(-logit)) : T(0);
            dL_dlogit_[at] = dL_dthickness * run_.delta(tile.samples[at]) * slope;
        }
    }

    /// From the gradient of a layer's argument to that of the layer before, with all sums between.
    void go_behind(std::size_t layer, bool density) {
        const std::int64_t width = extents_.width, points = run_.tile().points();
        const PackedLayer<T>& packed = face_.layers[layer];
        multiply_packed(behind_, width, LeftMatrix<T>{gradient_, width}, points, packed.before_back);
        LayerSums<T>& sums = sums_.layers[layer];
        LayerSums<T>& below = sums_.layers[layer - 1];
        const std::int64_t first = extents_.inputs[layer].encoding;
        const T* bias = face_.layers[layer - 1].bias;
        for (std::int64_t point = 0; point < points; ++point) {
            const T* const z = arguments(layer - 1) + point * width;
            T* const h = behind_ + point * width;
            T* const x = activation_ + point * width;
            const T* const scale = packed.scale + first;
            T* const columns = sums.columns.data() + first;
            T* const rows = below.rows.data();
            T* const biases = below.bias.data();
            if (density) {
                const T dL_dlogit = dL_dlogit_[static_cast<std::size_t>(point)];
                const T* const weight = face_.density_weight;
                T* const weights = sums_.density_weight.data();
                sums_.density_bias += dL_dlogit;
                for_each_argument(z, [=](std::int64_t i, T sine, T cosine) {
                    x[i] = sine;
                    columns[i] += sine * h[i];
                    weights[i] += sine * dL_dlogit;
                    const T g = (scale[i] * h[i] + weight[i] * dL_dlogit) * cosine;
                    h[i] = g;
                    rows[i] += g * (z[i] - bias[i]);
                    biases[i] += g;
                });
            } else {
                for_each_argument(z, [=](std::int64_t i, T sine, T cosine) {
                    x[i] = sine;
                    columns[i] += sine * h[i];
                    const T g = scale[i] * h[i] * cosine;
                    h[i] = g;
                    rows[i] += g * (z[i] - bias[i]);
                    biases[i] += g;
                });
            }
        }
        if (with_weights_) add_weight_gradient(layer, first, activation_, width, width);
        if (first > 0) add_encoding(layer);
    }

    /// What the encoding contributes to the sums of a layer that it enters; it needs no gradient itself.
    void add_encoding(std::size_t layer) {
        const std::int64_t stride = run_.encoding_stride(), length = extents_.encoding, points = run_.tile().points();
        multiply_packed(encoding_gradient_.get(), stride, LeftMatrix<T>{gradient_, extents_.width}, points,
                        face_.layers[layer].encoding_back);
        T* const columns = sums_.layers[layer].columns.data();
        for (std::int64_t point = 0; point < points; ++point) {
            const T* const x = run_.encoding() + point * stride;
            const T* const h = encoding_gradient_.get() + point * stride;
            for (std::int64_t i = 0; i < length; ++i) columns[i] += x[i] * h[i];
        }
        if (with_weights_) add_weight_gradient(layer, 0, run_.encoding(), length, stride);
    }

    /// dL/dW' += g^T x for the columns from `first` on.
    void add_weight_gradient(std::size_t layer, std::int64_t first, const T* x, std::int64_t columns, std::int64_t stride) {
        const std::int64_t width = extents_.width;
        const LayerInput& input = extents_.inputs[layer];
        multiply_packed(sums_.layers[layer].weight.data() + first, input.encoding + input.before,
                        LeftMatrix<T>{gradient_, 1, width}, width, PackedMatrix<T>(x, run_.tile().points(), columns, stride, 1),
                        Epilogue<T>{.present_values = true});
    }

    RayRun<T>& run_;
    const Face<T>& face_;
    const Extents& extents_;
    NetworkSums<T>& sums_;
    const T* kept_;
    bool with_weights_;
    std::int64_t size_;  ///< of a tile's layer
    std::size_t layers_;
    std::unique_ptr<T[]> computed_;  ///< arguments of all layers
    std::unique_ptr<T[]> buffers_;
    T* activation_;
    T* gradient_;  ///< of the present layer's argument
    T* behind_;
    std::unique_ptr<T[]> encoding_gradient_;
    std::vector<T> dL_dlogit_;
    std::vector<T> dL_dweight_;
};

template <class T>
NetworkSums<T> sums_of_face(const RayPoints& rays, const Face<T>& packed, const Extents& extents, std::int64_t face,
                            const T* kept, const T* dL_dy, bool with_weights) {
    std::vector<NetworkSums<T>> parts(static_cast<std::size_t>(chunk_count(extents.rays, extents.rays_in_run())),
                                      NetworkSums<T>(extents, with_weights));
    for_each_run(extents, [&](std::int64_t first, std::int64_t end, std::int64_t index) {
        RayRun<T> run(rays, packed, extents, face);
        GradientRun<T>(run, packed, extents, parts[static_cast<std::size_t>(index)], kept, with_weights)(first, end, dL_dy);
    });
    NetworkSums<T>& total = parts.front();
    for (std::size_t i = 1; i < parts.size(); ++i) {
        for (std::size_t layer = 0; layer < total.layers.size(); ++layer) {
            add_to(total.layers[layer].columns, parts[i].layers[layer].columns);
            add_to(total.layers[layer].rows, parts[i].layers[layer].rows);
            add_to(total.layers[layer].bias, parts[i].layers[layer].bias);
            add_to(total.layers[layer].weight, parts[i].layers[layer].weight);
        }
        add_to(total.density_weight, parts[i].density_weight);
        total.density_bias += parts[i].density_bias;
    }
    return std::move(total);
}

/// Adds one face's sums to the gradients. `layer` is what the gradients belong to.
template <class T>
void add_face(ModulatedLayerOf<Tensor>& gradient, const LayerSums<T>& sums, const PackedLayer<T>& layer, std::int64_t face) {
    const auto out = static_cast<std::int64_t>(sums.rows.size()), in = static_cast<std::int64_t>(sums.columns.size());
    std::ranges::copy(sums.columns, gradient.scale.mutable_values<T>().data() + face * in);
    T* const demodulation = gradient.demodulation.mutable_values<T>().data() + face * out;
    T* const bias = gradient.bias.mutable_values<T>().data();
    for (std::int64_t o = 0; o < out; ++o) {
        demodulation[o] = sums.rows[static_cast<std::size_t>(o)] / layer.demodulation[o];
        bias[o] += sums.bias[static_cast<std::size_t>(o)];
    }
    if (sums.weight.empty()) return;
    T* const weight = gradient.weight.mutable_values<T>().data();
    for (std::int64_t o = 0; o < out; ++o) {
        const T* const from = sums.weight.data() + o * in;
        for (std::int64_t i = 0; i < in; ++i) weight[o * in + i] += layer.demodulation[o] * layer.scale[i] * from[i];
    }
}

SineNetworkOf<Tensor> zeros_like(const SineNetworkOf<Tensor>& network, bool with_weights) {
    const auto zeros = [](const Tensor& x) { return Tensor::zeros(x.shape(), x.dtype()); };
    SineNetworkOf<Tensor> result{.frequencies = network.frequencies,
                                 .skip_layer = network.skip_layer,
                                 .layers = {},
                                 .density_weight = zeros(network.density_weight),
                                 .density_bias = zeros(network.density_bias)};
    for (const ModulatedLayerOf<Tensor>& layer : network.layers) {
        result.layers.push_back(
            {with_weights ? zeros(layer.weight) : Tensor{}, zeros(layer.scale), zeros(layer.demodulation), zeros(layer.bias)});
    }
    return result;
}

}  // namespace

SineRaysResult sine_rays(const RayPoints& rays, const SineNetworkOf<Tensor>& network, bool keep_arguments) {
    const Extents extents(rays, network);
    SineRaysResult result{Tensor({extents.faces, extents.rays, extents.columns()}, rays.deltas.dtype()), {}};
    if (keep_arguments) {
        result.arguments = Tensor({extents.faces, std::ssize(extents.inputs), extents.rays * extents.samples, extents.width},
                                  rays.deltas.dtype());
    }
    dispatch(result.value.dtype(), [&]<class T>(T) {
        T* const values = result.value.mutable_values<T>().data();
        T* const arguments = keep_arguments ? result.arguments.mutable_values<T>().data() : nullptr;
        for (std::int64_t face = 0; face < extents.faces; ++face) {
            const Face<T> packed = pack<T>(network, extents, face, false);
            T* const of_face = keep_arguments ? arguments + face * extents.kept_numbers() : nullptr;
            for_each_run(extents, [&](std::int64_t first, std::int64_t end, std::int64_t) {
                RayRun<T> run(rays, packed, extents, face);
                render_run(run, extents, first, end, of_face, values + face * extents.rays * extents.columns());
            });
        }
    });
    return result;
}

SineNetworkOf<Tensor> sine_rays_gradient(const RayPoints& rays, const SineNetworkOf<Tensor>& network, const Tensor& arguments,
                                         const Tensor& dL_dy, bool with_weights) {
    const Extents extents(rays, network);
    SineNetworkOf<Tensor> gradients = zeros_like(network, with_weights);
    dispatch(dL_dy.dtype(), [&]<class T>(T) {
        const T* const dL_dvalues = dL_dy.values<T>().data();
        for (std::int64_t face = 0; face < extents.faces; ++face) {
            const Face<T> packed = pack<T>(network, extents, face, true);
            const T* const kept = arguments.defined() ? arguments.values<T>().data() + face * extents.kept_numbers() : nullptr;
            const NetworkSums<T> sums = sums_of_face(rays, packed, extents, face, kept,
                                                     dL_dvalues + face * extents.rays * extents.columns(), with_weights);
            for (std::size_t i = 0; i < packed.layers.size(); ++i)
                add_face(gradients.layers[i], sums.layers[i], packed.layers[i], face);
            T* const density_weight = gradients.density_weight.mutable_values<T>().data();
            for (std::int64_t i = 0; i < extents.width; ++i)
                density_weight[i] += sums.density_weight[static_cast<std::size_t>(i)];
            gradients.density_bias.mutable_values<T>()[0] += sums.density_bias;
        }
    });
    return gradients;
}

}  // namespace stymo::kernels
