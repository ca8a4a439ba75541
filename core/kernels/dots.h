#pragma once

#include <cstdint>

namespace stymo::kernels {

/// Inner products of each of `count_x` vectors with each of a few others: products that read their
/// larger operand once, for which packing it would take longer. Both sides contiguous, one vector
/// of length k after the other.
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

/// Sums of each lane, and then of lanes: in an order that depends on the instruction set.
template <class T>
void multiply_dots(const Dots<T>& dots);

}  // namespace stymo::kernels
