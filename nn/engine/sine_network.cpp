#include "nn/engine/sine_network.h"

#include <utility>

namespace stymo {

namespace {

template <class T>
FoldedLayer folded(const ModulatedLayerOf<Tensor>& layer, std::int64_t face) {
    const std::int64_t out = layer.weight.shape(1), in = layer.weight.shape(2);
    FoldedLayer result{Tensor({out, in}, layer.weight.dtype()), layer.bias, Activation::sine};
    const T* from = layer.weight.values<T>().data();
    const T* const scale = layer.scale.values<T>().data() + face * in;
    const T* const demodulation = layer.demodulation.values<T>().data() + face * out;
    T* to = result.weight.mutable_values<T>().data();
    for (std::int64_t o = 0; o < out; ++o) {
        for (std::int64_t i = 0; i < in; ++i) *to++ = *from++ * scale[i] * demodulation[o];
    }
    return result;
}

}  // namespace

FoldedField folded(const SineNetworkOf<Tensor>& network, std::int64_t face) {
    FoldedField field{.frequencies = network.frequencies,
                      .skip_layer = network.skip_layer,
                      .layers = {},
                      .density = {network.density_weight, network.density_bias},
                      .feature0 = {},
                      .feature1 = {}};
    dispatch(network.density_weight.dtype(), [&]<class T>(T) {
        for (const ModulatedLayerOf<Tensor>& layer : network.layers)
            field.layers.push_back(folded<T>(layer, face));
    });
    field.feature0 = std::move(field.layers.back());
    field.layers.pop_back();
    return field;
}

}  // namespace stymo
