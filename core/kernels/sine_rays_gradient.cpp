#include "core/kernels/ray_run.h"
#include "core/kernels/sine_rays.h"
#include "core/work_counts.h"

namespace stymo::kernels {

namespace {

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

    NetworkSums(const RayExtents& extents, bool with_weights) : density_weight(static_cast<std::size_t>(extents.width)) {
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
    GradientRun(RayRun<T>& run, const PackedFace<T>& face, const RayExtents& extents, NetworkSums<T>& sums, const T* kept,
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
            if (kept_ == nullptr) work::count_field_points(run_.tile().points());
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
        const RayTile<T>& tile = run_.tile();
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
        const RayTile<T>& tile = run_.tile();
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
    const PackedFace<T>& face_;
    const RayExtents& extents_;
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
NetworkSums<T> sums_of_face(const RayPoints& rays, const PackedFace<T>& packed, const RayExtents& extents, std::int64_t face,
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

SineNetworkOf<Tensor> sine_rays_gradient(const RayPoints& rays, const SineNetworkOf<Tensor>& network, const Tensor& arguments,
                                         const Tensor& dL_dy, bool with_weights) {
    const RayExtents extents(rays, network);
    SineNetworkOf<Tensor> gradients = zeros_like(network, with_weights);
    dispatch(dL_dy.dtype(), [&]<class T>(T) {
        const T* const dL_dvalues = dL_dy.values<T>().data();
        for (std::int64_t face = 0; face < extents.faces; ++face) {
            const PackedFace<T> packed = pack<T>(network, extents, face, true);
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
