// The gradient of field and compositing, tile by tile.
//
// A step has hundreds of thousands of samples, each with `layers * width` activations, which would
// not fit into memory for a batch. Each tile of rays is therefore computed again (or, if there is
// memory for it, the arguments of its sines are read back) and is then differentiated from the rays
// to the first layer. The arguments z suffice: sin(z), the input of the next layer, and cos(z), the
// derivative, come from one range reduction.
//
// A layer. With the input x, the weight W, the scale s and the demodulation d of a face, and the
// bias b, a layer computes
//
//     z_o = d_o sum_i W_oi s_i x_i + b_o,        next input: sin(z_o).
//
// Let g_o = dL/dz_o at a sample p. One matrix product,
//
//     h_i = sum_o W_oi d_o g_o,
//
// gives all that a fit of codes needs:
//
//     dL/dx_i = s_i h_i                          goes on to the layer below, times cos(z_i)
//     dL/ds_i = sum_p x_pi h_pi
//     dL/dd_o = sum_p g_po sum_i W_oi s_i x_pi = sum_p g_po (z_po - b_o) / d_o
//     dL/db_o = sum_p g_po
//
// The second form of dL/dd needs no product, because z is known. The way over the gradient of the
// folded weight d_o W_oi s_i would need one more product, g^T x, for each layer and face. Only if a
// weight is trained is this product made:
//
//     dL/dW_oi = d_o s_i sum_p g_po x_pi.
//
// s and d are functions of the style, and d of W too. Autograd continues from their gradients
// (ModulatedLinear::parts).
//
// Compositing. Let tau_i be the optical depth of sample i, t_1 = 1, t_{i+1} = t_i exp(-tau_i), and
// w_i = t_i - t_{i+1} its weight. The result has all w_i, t_{N+1}, and sum_i w_i f_i with the
// features f_i. So dL/dw_i has two parts, the gradient of the weight itself and f_i dL/df. From
// dw_k/dtau_k = t_{k+1}, dw_i/dtau_k = -w_i for i > k and dt_{N+1}/dtau_k = -t_{N+1} follows
//
//     dL/dtau_k = t_{k+1} dL/dw_k - (sum_{i>k} w_i dL/dw_i + t_{N+1} dL/dt_{N+1}).
//
// The sum in brackets grows from back to front. It is kept in double, because the two terms cancel
// if all dL/dw_i and dL/dt_{N+1} are equal.
//
// Samples whose weight is below RayPoints::gradient_tolerance are left out: they get no gradient,
// but their optical depth still attenuates those behind them. docs/studies/samples-of-training.md
// measures what this changes.
//
// The sums of a face are kept for each of at most `ray_runs` runs of rays and are added in order.
// The result therefore does not depend on the number of threads. Derivatives of higher order come
// from the composition of ops (render_field.cpp).

#include <utility>

#include "core/kernels/sine.h"
#include "nn/engine/rays_of_face.h"

namespace stymo {

namespace {

/// The data of a layer that the backward pass of one face reads. Inputs are in the order of
/// PackedField::input_order.
template <class T>
struct BackwardLayer {
    std::vector<std::int64_t> inputs;  ///< number of each stored input, -1 for padding
    kernels::PackedMatrix<T> weight;   ///< demodulation_o W_oi, for products with rows of outputs
    std::vector<T> scale;              ///< of each input
    const T* demodulation;
    const T* bias;

    BackwardLayer(const ModulatedLayerOf<Tensor>& layer, std::int64_t face,
                  std::vector<std::int64_t> order)
        : inputs(std::move(order)),
          scale(inputs.size()),
          demodulation(layer.demodulation.values<T>().data() + face * layer.demodulation.shape(1)),
          bias(layer.bias.values<T>().data()) {
        const std::int64_t out = layer.weight.shape(1), in = layer.weight.shape(2);
        const T* const weights = layer.weight.values<T>().data();
        const T* const scales = layer.scale.values<T>().data() + face * in;
        std::vector<T> demodulated(static_cast<std::size_t>(out) * inputs.size());
        for (std::size_t i = 0; i < inputs.size(); ++i) {
            if (inputs[i] < 0) continue;
            scale[i] = scales[inputs[i]];
            for (std::int64_t o = 0; o < out; ++o)
                demodulated[static_cast<std::size_t>(o) * inputs.size() + i] =
                    demodulation[o] * weights[o * in + inputs[i]];
        }
        weight = kernels::PackedMatrix<T>(demodulated.data(), out, std::ssize(inputs),
                                          std::ssize(inputs), 1);
    }
};

/// Sums over the points p of one run or of all runs: x_pi h_pi for input i, g_po (z_po - b_o) for
/// output o, g_po for the bias, and g_po x_pi for the weight.
template <class T>
struct LayerSums {
    std::vector<T> inputs, outputs, bias, weight;
};

template <class T>
struct NetworkSums {
    std::vector<LayerSums<T>> layers;
    std::vector<T> density_weight;
    T density_bias = T(0);

    NetworkSums(const std::vector<BackwardLayer<T>>& network, std::int64_t width, bool with_weights)
        : density_weight(static_cast<std::size_t>(width)) {
        const auto out = static_cast<std::size_t>(width);
        for (const BackwardLayer<T>& layer : network) {
            const std::size_t in = layer.inputs.size();
            layers.push_back({std::vector<T>(in), std::vector<T>(out), std::vector<T>(out),
                              std::vector<T>(with_weights ? out * in : std::size_t{0})});
        }
    }

    void add(const NetworkSums& more) {
        const auto add_to = [](std::vector<T>& sums, const std::vector<T>& other) {
            for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += other[i];
        };
        for (std::size_t layer = 0; layer < layers.size(); ++layer) {
            add_to(layers[layer].inputs, more.layers[layer].inputs);
            add_to(layers[layer].outputs, more.layers[layer].outputs);
            add_to(layers[layer].bias, more.layers[layer].bias);
            add_to(layers[layer].weight, more.layers[layer].weight);
        }
        add_to(density_weight, more.density_weight);
        density_bias += more.density_bias;
    }
};

/// The field and the samples of one face for the backward pass.
template <class T>
struct BackwardFace {
    PackedField<T> field;
    std::vector<BackwardLayer<T>> layers;
    FaceSamples<T> samples;
    const T* density_weight;
    const T* kept;  ///< sine arguments, or null if they must be computed
    const T* dL_dy;

    BackwardFace(const RayPoints& rays, const SineNetworkOf<Tensor>& network,
                 const RayExtents& extents, std::int64_t face, const FieldPassResult& forward,
                 const Tensor& dL_dvalues)
        : field(folded(network, face)),
          samples(rays, extents, face),
          density_weight(network.density_weight.values<T>().data()),
          kept(forward.arguments.defined()
                   ? forward.arguments.values<T>().data() + face * extents.face_arguments()
                   : nullptr),
          dL_dy(dL_dvalues.values<T>().data() + face * extents.rays * extents.columns()) {
        if (rays.gradient_tolerance > 0.0)
            samples.keep_heavy(
                forward.value.values<T>().data() + face * extents.rays * extents.columns(),
                extents.columns(), static_cast<T>(rays.gradient_tolerance));
        for (std::size_t i = 0; i < network.layers.size(); ++i) {
            // The layer of the features reads no encoding.
            layers.emplace_back(network.layers[i], face,
                                i + 1 == network.layers.size() ? hidden_inputs(extents.width)
                                                               : field.input_order(i));
        }
    }

private:
    static std::vector<std::int64_t> hidden_inputs(std::int64_t width) {
        std::vector<std::int64_t> inputs(static_cast<std::size_t>(width));
        for (std::size_t i = 0; i < inputs.size(); ++i) inputs[i] = static_cast<std::int64_t>(i);
        return inputs;
    }
};

/// The backward pass of one run, tile by tile.
template <class T>
class BackwardRun {
public:
    BackwardRun(const BackwardFace<T>& face, const RayExtents& extents, NetworkSums<T>& sums,
                bool with_weights)
        : face_(face),
          extents_(extents),
          sums_(sums),
          with_weights_(with_weights),
          stride_(face.field.joined_stride()),
          encoding_(face.field.encoding()),
          features_(face.layers.size() - 1),
          cosines_(static_cast<std::size_t>(extents.width)) {
        const std::int64_t points = extents.largest_tile();
        face.field.reserve(points, tile_.field);
        if (face.kept == nullptr) grow(computed_, extents.layers * points * extents.width);
        grow(gradient_, points * stride_);
        grow(next_gradient_, points * stride_);
    }

    void operator()(std::int64_t first, std::int64_t end) {
        for_each_tile(face_.samples, extents_, first, end, tile_, [&] {
            load_or_recompute_arguments();
            tile_.composite(face_.samples.selection, face_.samples);
            differentiate_compositing();
            for (std::size_t layer = features_; layer > 0; --layer) {
                differentiate_layer(layer);
                std::swap(gradient_, next_gradient_);
            }
            multiply_back(0);
            add_encoding(0);
            if (with_weights_) add_weight_gradient(0);
        });
    }

private:
    [[nodiscard]] const T* arguments(std::size_t layer) const {
        const auto index = static_cast<std::int64_t>(layer);
        if (face_.kept == nullptr)
            return computed_.data() + index * extents_.largest_tile() * extents_.width;
        return face_.kept + index * extents_.layer_arguments() +
               tile_.first_ray * extents_.samples * extents_.width;
    }

    /// Makes the arguments of all layers, the encoding and the logits available.
    void load_or_recompute_arguments() {
        if (face_.kept != nullptr) {
            face_.field.encode(tile_.points, tile_.field);
            face_.field.evaluate(arguments(features_ - 1), tile_.count(), tile_.field);
            return;
        }
        const SineArgumentRows<T> rows{computed_.data(), extents_.largest_tile() * extents_.width};
        face_.field.evaluate(tile_.points, tile_.field, rows);
        face_.field.feature_arguments(tile_.count(), tile_.field, rows.layer(features_));
    }

    /// The hidden part of a point's row in `gradient_` or `next_gradient_`.
    [[nodiscard]] T* hidden_row(AlignedVector<T>& gradient, std::int64_t point) const {
        return gradient.data() + point * stride_ + encoding_;
    }

    /// Computes the gradients of the features' arguments and of the logits from the result's
    /// gradient.
    void differentiate_compositing() {
        const std::int64_t width = extents_.width;
        dL_dlogit_.resize(tile_.weights.size());
        dL_dweight_.resize(tile_.weights.size());
        const T* const bias = face_.layers.back().bias;
        T* const outputs = sums_.layers.back().outputs.data();
        T* const biases = sums_.layers.back().bias.data();
        T* const features = tile_.field.features.data();
        T* const cosines = cosines_.data();
        for (std::int64_t ray = tile_.first_ray; ray < tile_.end_ray; ++ray) {
            const T* row = face_.dL_dy + ray * extents_.columns();
            const T* const dL_dfeature = row + extents_.samples + 1;
            std::int64_t point = tile_.begin_of(ray);
            for (const std::int32_t sample : face_.samples.selection.samples_of(ray)) {
                const auto at = static_cast<std::size_t>(point);
                const T weight = tile_.weights[at];
                const T* const z = arguments(features_) + point * width;
                T* const g = hidden_row(gradient_, point++);
                kernels::sine_cosine(z, features, cosines, width);
                T product = T(0);
#pragma omp simd reduction(+ : product)
                for (std::int64_t i = 0; i < width; ++i) {
                    g[i] = weight * dL_dfeature[i] * cosines[i];
                    outputs[i] += g[i] * (z[i] - bias[i]);
                    biases[i] += g[i];
                    product += dL_dfeature[i] * features[i];
                }
                dL_dweight_[at] = product + row[sample];
            }
            differentiate_weights(ray, row[extents_.samples]);
        }
    }

    /// Computes dL/dlogit of a ray's samples from dL/dw and the gradient of its transmittance.
    void differentiate_weights(std::int64_t ray, T dL_dtransmittance) {
        const std::span<const std::int32_t> selected = face_.samples.selection.samples_of(ray);
        double behind = static_cast<double>(tile_.transmittance_of(ray)) *
                        static_cast<double>(dL_dtransmittance);
        for (std::size_t i = selected.size(); i-- > 0;) {
            const std::size_t at = static_cast<std::size_t>(tile_.begin_of(ray)) + i;
            const T dL_dthickness =
                tile_.transmittances[at] * dL_dweight_[at] - static_cast<T>(behind);
            behind += static_cast<double>(tile_.weights[at]) * static_cast<double>(dL_dweight_[at]);
            const T logit = tile_.field.logits[at];
            const bool within = density_of_logit(logit) < static_cast<T>(largest_density);
            const T slope = within ? T(1) / (T(1) + std::exp(-logit)) : T(0);
            dL_dlogit_[at] = dL_dthickness * face_.samples.length(ray, selected[i]) * slope;
        }
    }

    /// next_gradient = gradient of a layer's argument times its demodulated weight.
    void multiply_back(std::size_t layer) {
        kernels::multiply_packed(next_gradient_.data() + first_input(layer), stride_,
                                 kernels::LeftMatrix<T>{hidden_row(gradient_, 0), stride_},
                                 tile_.count(), face_.layers[layer].weight);
    }

    /// Where a layer's inputs begin in a row of (encoding | hidden).
    [[nodiscard]] std::int64_t first_input(std::size_t layer) const {
        return layer == 0 || std::ssize(face_.layers[layer].inputs) > extents_.width ? 0
                                                                                     : encoding_;
    }

    /// Computes the gradient of the previous layer's argument from that of this layer, and adds to
    /// the sums of both layers. Leaves the activations of the previous layer in tile_.field.joined.
    void differentiate_layer(std::size_t layer) {
        multiply_back(layer);
        const std::int64_t width = extents_.width, first = encoding_ - first_input(layer);
        const T* const scale = face_.layers[layer].scale.data() + first;
        const T* const bias = face_.layers[layer - 1].bias;
        T* const inputs = sums_.layers[layer].inputs.data() + first;
        T* const outputs = sums_.layers[layer - 1].outputs.data();
        T* const biases = sums_.layers[layer - 1].bias.data();
        T* const cosines = cosines_.data();
        for (std::int64_t point = 0; point < tile_.count(); ++point) {
            const T* const z = arguments(layer - 1) + point * width;
            T* const h = hidden_row(next_gradient_, point);
            T* const x = tile_.field.joined.data() + point * stride_ + encoding_;
            kernels::sine_cosine(z, x, cosines, width);
#pragma omp simd
            for (std::int64_t i = 0; i < width; ++i) {
                inputs[i] += x[i] * h[i];
                h[i] *= scale[i];
            }
            if (layer == features_) add_density(point, x, h);
#pragma omp simd
            for (std::int64_t i = 0; i < width; ++i) {
                h[i] *= cosines[i];
                outputs[i] += h[i] * (z[i] - bias[i]);
                biases[i] += h[i];
            }
        }
        if (first > 0) add_encoding(layer);
        if (with_weights_) add_weight_gradient(layer);
    }

    /// Adds the density's part to the gradient of its input x.
    void add_density(std::int64_t point, const T* x, T* dL_dx) {
        const T dL_dlogit = dL_dlogit_[static_cast<std::size_t>(point)];
        T* const sums = sums_.density_weight.data();
        sums_.density_bias += dL_dlogit;
#pragma omp simd
        for (std::int64_t i = 0; i < extents_.width; ++i) {
            sums[i] += x[i] * dL_dlogit;
            dL_dx[i] += face_.density_weight[i] * dL_dlogit;
        }
    }

    /// Adds the encoding's part to the sums of a layer that reads it. The encoding itself needs no
    /// gradient.
    void add_encoding(std::size_t layer) {
        T* const inputs = sums_.layers[layer].inputs.data();
        for (std::int64_t point = 0; point < tile_.count(); ++point) {
            const T* const x = tile_.field.joined.data() + point * stride_;
            const T* const h = next_gradient_.data() + point * stride_;
#pragma omp simd
            for (std::int64_t i = 0; i < encoding_; ++i) inputs[i] += x[i] * h[i];
        }
    }

    /// dL/dW' += g^T x
    void add_weight_gradient(std::size_t layer) {
        const std::int64_t in = std::ssize(face_.layers[layer].inputs);
        const T* const x = tile_.field.joined.data() + first_input(layer);
        kernels::multiply_packed(sums_.layers[layer].weight.data(), in,
                                 kernels::LeftMatrix<T>{hidden_row(gradient_, 0), 1, stride_},
                                 extents_.width,
                                 kernels::PackedMatrix<T>(x, tile_.count(), in, stride_, 1),
                                 kernels::Epilogue<T>{.present_values = true});
    }

    const BackwardFace<T>& face_;
    const RayExtents& extents_;
    NetworkSums<T>& sums_;
    bool with_weights_;
    std::int64_t stride_;  ///< of rows (encoding | hidden)
    std::int64_t encoding_;
    std::size_t features_;  ///< the layer of the features
    RayTile<T> tile_;
    AlignedVector<T> computed_;  ///< arguments of all layers
    /// Gradient of the current layer's argument, in the hidden part of each row.
    AlignedVector<T> gradient_;
    AlignedVector<T> next_gradient_;
    std::vector<T> cosines_;
    std::vector<T> dL_dlogit_;
    std::vector<T> dL_dweight_;
};

template <class T>
NetworkSums<T> sums_of_face(const BackwardFace<T>& face, const RayExtents& extents,
                            bool with_weights) {
    std::vector<NetworkSums<T>> parts(
        static_cast<std::size_t>(chunk_count(extents.rays, extents.rays_in_run())),
        NetworkSums<T>(face.layers, extents.width, with_weights));
    for_each_run(extents, [&](std::int64_t first, std::int64_t end, std::int64_t index) {
        BackwardRun<T>(face, extents, parts[static_cast<std::size_t>(index)], with_weights)(first,
                                                                                            end);
    });
    for (std::size_t i = 1; i < parts.size(); ++i) parts.front().add(parts[i]);
    return std::move(parts.front());
}

/// Adds one face's sums to the gradients of a layer.
template <class T>
void add_layer(ModulatedLayerOf<Tensor>& gradient, const LayerSums<T>& sums,
               const BackwardLayer<T>& layer, std::int64_t face) {
    const std::int64_t out = gradient.bias.shape(0), in = gradient.scale.shape(2);
    T* const scale = gradient.scale.mutable_values<T>().data() + face * in;
    T* const demodulation = gradient.demodulation.mutable_values<T>().data() + face * out;
    T* const bias = gradient.bias.mutable_values<T>().data();
    for (std::int64_t o = 0; o < out; ++o) {
        demodulation[o] = sums.outputs[static_cast<std::size_t>(o)] / layer.demodulation[o];
        bias[o] += sums.bias[static_cast<std::size_t>(o)];
    }
    T* const weight = sums.weight.empty() ? nullptr : gradient.weight.mutable_values<T>().data();
    for (std::size_t i = 0; i < layer.inputs.size(); ++i) {
        const std::int64_t input = layer.inputs[i];
        if (input < 0) continue;
        scale[input] = sums.inputs[i];
        for (std::int64_t o = 0; weight != nullptr && o < out; ++o)
            weight[o * in + input] +=
                layer.demodulation[o] * layer.scale[i] *
                sums.weight[static_cast<std::size_t>(o) * layer.inputs.size() + i];
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
        result.layers.push_back({with_weights ? zeros(layer.weight) : Tensor{}, zeros(layer.scale),
                                 zeros(layer.demodulation), zeros(layer.bias)});
    }
    return result;
}

}  // namespace

SineNetworkOf<Tensor> render_field_backward(const RayPoints& rays,
                                            const SineNetworkOf<Tensor>& network,
                                            const FieldPassResult& forward, const Tensor& dL_dy,
                                            bool with_weights) {
    const RayExtents extents(rays, network);
    SineNetworkOf<Tensor> gradients = zeros_like(network, with_weights);
    dispatch(dL_dy.dtype(), [&]<class T>(T) {
        for (std::int64_t index = 0; index < extents.faces; ++index) {
            const BackwardFace<T> face(rays, network, extents, index, forward, dL_dy);
            const NetworkSums<T> sums = sums_of_face(face, extents, with_weights);
            for (std::size_t i = 0; i < face.layers.size(); ++i)
                add_layer(gradients.layers[i], sums.layers[i], face.layers[i], index);
            const std::span<T> density_weight = gradients.density_weight.mutable_values<T>();
            for (std::size_t i = 0; i < density_weight.size(); ++i)
                density_weight[i] += sums.density_weight[i];
            gradients.density_bias.mutable_values<T>()[0] += sums.density_bias;
        }
    });
    return gradients;
}

}  // namespace stymo
