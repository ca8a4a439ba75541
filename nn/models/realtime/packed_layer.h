#pragma once

#include <cstdint>
#include <vector>

#include "core/kernels/gemm.h"
#include "nn/layers/linear.h"

namespace stymo {

/// A folded layer in the order in which products read it; T = float, BFloat16 or Float16 is the type of weights and activations.
template <class T>
struct PackedLayer {
    kernels::PackedMatrix<T> weight;
    std::vector<float> bias;
    Activation activation = Activation::none;

    PackedLayer() = default;
    explicit PackedLayer(const FoldedLayer& layer)
        : weight(layer.weight.values<float>().data(), layer.weight.shape(1), layer.weight.shape(0), 1, layer.weight.shape(1)),
          bias(layer.bias.values<float>().begin(), layer.bias.values<float>().end()),
          activation(layer.activation) {}

    [[nodiscard]] std::int64_t inputs() const { return weight.inner_length(); }
    [[nodiscard]] std::int64_t outputs() const { return weight.columns(); }

    /// x (rows, inputs) -> out (rows, outputs), which may be float whatever T is.
    template <class Out>
    void apply(Out* out, const T* x, std::int64_t rows) const {
        kernels::multiply_packed(out, outputs(), kernels::LeftMatrix<T>{x, inputs()}, rows, weight,
                                 kernels::Epilogue<float>{.bias = bias.data(), .activation = activation});
    }
};

}  // namespace stymo
