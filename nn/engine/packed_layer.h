#pragma once

#include <cstdint>
#include <vector>

#include "core/kernels/gemm.h"
#include "nn/layers/linear.h"

namespace stymo {

/// The type of sums and results for weights and activations of type T: float if T has 16 bits, else
/// T.
template <class T>
using Real = typename kernels::PackedMatrix<T>::Source;

template <class T>
[[nodiscard]] std::vector<T> values_of(const Tensor& tensor) {
    const auto all = tensor.values<T>();
    return {all.begin(), all.end()};
}

/// A folded layer in the memory layout of the matrix products. T = float, double, BFloat16 or
/// Float16 is the type of weights and activations. The tensors of the FoldedLayer must have the
/// type Real<T>.
template <class T>
struct PackedLayer {
    kernels::PackedMatrix<T> weight;
    std::vector<Real<T>> bias;
    Activation activation = Activation::none;

    PackedLayer() = default;
    explicit PackedLayer(const FoldedLayer& layer)
        : weight(layer.weight.values<Real<T>>().data(), layer.weight.shape(1),
                 layer.weight.shape(0), 1, layer.weight.shape(1)),
          bias(values_of<Real<T>>(layer.bias)),
          activation(layer.activation) {}

    [[nodiscard]] std::int64_t inputs() const { return weight.inner_length(); }
    [[nodiscard]] std::int64_t outputs() const { return weight.columns(); }

    /// x (rows, inputs) -> out (rows, outputs). Out is T or Real<T>.
    template <class Out>
    void apply(Out* out, const T* x, std::int64_t rows) const {
        apply(out, outputs(), {x, inputs()}, rows, activation);
    }
    /// The same with rows of `out` that are `stride` elements apart, and with the activation
    /// `instead` of the layer's own.
    template <class Out>
    void apply(Out* out, std::int64_t stride, const kernels::LeftMatrix<T>& x, std::int64_t rows,
               Activation instead) const {
        kernels::multiply_packed(
            out, stride, x, rows, weight,
            kernels::Epilogue<Real<T>>{.bias = bias.data(), .activation = instead});
    }
};

}  // namespace stymo
