#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#include "core/kernels/gemm.h"
#include "nn/layers/linear.h"

namespace stymo {

/// Allocates memory that begins on a cache line, so that no vector load crosses two lines.
template <class T>
struct CacheLineAllocator {
    using value_type = T;
    static constexpr std::align_val_t alignment{64};

    CacheLineAllocator() = default;
    template <class Other>
    explicit CacheLineAllocator(const CacheLineAllocator<Other>&) {}

    [[nodiscard]] T* allocate(std::size_t count) {
        return static_cast<T*>(::operator new(count * sizeof(T), alignment));
    }
    void deallocate(T* from, std::size_t) { ::operator delete(from, alignment); }
    [[nodiscard]] bool operator==(const CacheLineAllocator&) const { return true; }
};

template <class T>
using AlignedVector = std::vector<T, CacheLineAllocator<T>>;

/// Resizes a buffer to `size` elements if it has fewer. It never shrinks.
template <class T, class Allocator>
void grow(std::vector<T, Allocator>& buffer, std::int64_t size) {
    if (static_cast<std::int64_t>(buffer.size()) < size)
        buffer.resize(static_cast<std::size_t>(size));
}

template <class T>
[[nodiscard]] std::vector<T> values_of(const Tensor& tensor) {
    const auto all = tensor.values<T>();
    return {all.begin(), all.end()};
}

/// A folded layer in the memory layout of the matrix products. T: float, double.
template <class T>
struct PackedLayer {
    kernels::PackedMatrix<T> weight;
    std::vector<T> bias;
    Activation activation = Activation::none;

    PackedLayer() = default;
    explicit PackedLayer(const FoldedLayer& layer, MatmulPrecision precision = matmul_precision())
        : weight(layer.weight.values<T>().data(), layer.weight.shape(1), layer.weight.shape(0), 1,
                 layer.weight.shape(1), precision),
          bias(values_of<T>(layer.bias)),
          activation(layer.activation) {}

    [[nodiscard]] std::int64_t inputs() const { return weight.inner_length(); }
    [[nodiscard]] std::int64_t outputs() const { return weight.columns(); }

    /// x (rows, inputs) -> out (rows, outputs).
    void apply(T* out, const T* x, std::int64_t rows) const {
        apply(out, outputs(), {x, inputs()}, rows, activation);
    }
    /// The same with rows of `out` that are `stride` elements apart, and with the activation
    /// `instead` of the layer's own.
    void apply(T* out, std::int64_t stride, const kernels::LeftMatrix<T>& x, std::int64_t rows,
               Activation instead) const {
        kernels::multiply_packed(out, stride, x, rows, weight,
                                 kernels::Epilogue<T>{.bias = bias.data(), .activation = instead});
    }
};

}  // namespace stymo
