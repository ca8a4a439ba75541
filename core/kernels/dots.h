#pragma once

#include <cstdint>

namespace stymo::kernels {

/// Inner products of each of `count_x` vectors with each of a few others. Such a product reads its
/// larger operand only once, so packing would take longer. On both sides the vectors of length k
/// are contiguous, one after the other.
template <class T>
struct Dots {
    const T* x;
    std::int64_t count_x;
    const T* y;
    std::int64_t count_y;
    std::int64_t k;
    T* c;  ///< element (i, j) at i * stride_x + j * stride_y
    std::int64_t stride_x;
    std::int64_t stride_y;
};

/// Adds the products in each vector lane, and then the lanes, so the order of the sum depends on
/// the instruction set.
template <class T>
void multiply_dots(const Dots<T>& dots);

}  // namespace stymo::kernels
