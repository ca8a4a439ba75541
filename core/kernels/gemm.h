#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/matmul_precision.h"
#include "core/op_options.h"

/// Matrix products on the calling thread. Google Highway chooses the instruction set at run time.
/// Every element of a result is one chain of fused multiply-adds in the order of the inner index,
/// or of sums of two products on matrix tiles (core/matmul_precision.h). It depends neither on the
/// position of its block nor on the number of threads.
namespace stymo::kernels {

/// The upper half of a float32, rounded to nearest even.
struct BFloat16 {
    std::uint16_t bits = 0;
};

[[nodiscard]] inline float widened(BFloat16 x) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(x.bits) << 16);
}
/// Rounds to nearest even. A NaN stays a NaN.
[[nodiscard]] inline BFloat16 rounded_to_bfloat16(float x) {
    const auto bits = std::bit_cast<std::uint32_t>(x);
    const std::uint32_t rounded = bits + 0x7FFF + (bits >> 16 & 1);
    const std::uint32_t quiet = bits | 0x400000;
    return {static_cast<std::uint16_t>((x == x ? rounded : quiet) >> 16)};
}

/// The right operand (k, n) of a product in the memory layout of the product. It is worth keeping
/// for several products. T: float, double.
template <class T>
class PackedMatrix {
public:
    PackedMatrix() = default;
    /// Packs the matrix with element (i, j) = b[i * inner_stride + j * column_stride]. One of the
    /// strides must be 1. A large matrix is packed by several threads. `precision` is that of all
    /// products with it; ignored for double.
    PackedMatrix(const T* b, std::int64_t k, std::int64_t n, std::int64_t inner_stride,
                 std::int64_t column_stride, MatmulPrecision precision = matmul_precision());

    /// Views b, whose rows are `inner_stride` apart, without packing it: for products with so few
    /// rows that packing would cost more than it saves. n must be a multiple of
    /// `usual_panel_width()`. b must outlive the view.
    [[nodiscard]] static PackedMatrix in_place(const T* b, std::int64_t k, std::int64_t n,
                                               std::int64_t inner_stride);

    /// Views panels that already have the layout of `panel()`, one after the other. They must
    /// outlive the view.
    [[nodiscard]] static PackedMatrix of_panels(const T* panels, std::int64_t k, std::int64_t n);
    /// Columns of a panel on this processor.
    [[nodiscard]] static std::int64_t usual_panel_width();

    [[nodiscard]] std::int64_t inner_length() const { return k_; }
    [[nodiscard]] std::int64_t columns() const { return n_; }
    [[nodiscard]] MatmulPrecision precision() const { return precision_; }
    [[nodiscard]] std::int64_t panel_width() const { return panel_width_; }
    [[nodiscard]] std::int64_t inner_stride() const { return inner_stride_; }
    /// All k rows of `panel_width()` columns, `inner_stride()` apart. Packed panels are contiguous,
    /// 64-byte aligned, and zero beyond column n.
    [[nodiscard]] const T* panel(std::int64_t index) const { return panels_ + index * panel_size_; }
    /// Number of BFloat16 parts of each number if panels are split for products on tiles
    /// (core/kernels/tile_product.h), else 0. If it is not 0, `split_panel()` replaces `panel()`.
    /// Only float32 below MatmulPrecision::highest is split.
    [[nodiscard]] int parts() const { return parts_; }
    [[nodiscard]] const BFloat16* split_panel(std::int64_t index) const {
        return reinterpret_cast<const BFloat16*>(panel(index));
    }

private:
    std::int64_t k_ = 0;
    std::int64_t n_ = 0;
    std::int64_t panel_width_ = 0;
    std::int64_t inner_stride_ = 0;
    std::int64_t panel_size_ = 0;  ///< elements from one panel to the next
    MatmulPrecision precision_ = matmul_precision();
    int parts_ = 0;
    const T* panels_ = nullptr;
    /// Never written after packing, so that copies may share it.
    std::shared_ptr<const T[]> storage_;
};

/// Left operand (m, k): element (row, i) is data[row * row_stride + i * inner_stride]. One of the
/// strides must be 1.
template <class T>
struct LeftMatrix {
    const T* data;
    std::int64_t row_stride;
    std::int64_t inner_stride = 1;
};

/// Operations on a product before it leaves the cache: activation(product + bias) or
/// activation(product + present values).
template <class T>
struct Epilogue {
    const T* bias = nullptr;      ///< one number for each column
    bool present_values = false;  ///< adds the product to the present values of the result; the
                                  ///< bias must then be null
    Activation activation = Activation::none;
    T* slope = nullptr;  ///< destination of the activation's derivative, with the row stride of the
                         ///< result; null: not wanted
};

/// c (m, n), rows `row_stride` apart, = epilogue(left * right).
template <class T>
void multiply_packed(T* c, std::int64_t row_stride, const LeftMatrix<T>& left, std::int64_t m,
                     const PackedMatrix<T>& right, const Epilogue<T>& epilogue = {});

/// Uninitialised scratch memory of the calling thread, one buffer for each T. It spares small
/// products an allocation. 64-byte aligned, and valid until the next call with the same T.
template <class T>
[[nodiscard]] T* scratch_of_thread(std::size_t count) {
    constexpr std::size_t alignment = 64;
    thread_local std::vector<T> room;
    if (room.size() < count + alignment / sizeof(T)) room.resize(count + alignment / sizeof(T));
    const auto address = reinterpret_cast<std::uintptr_t>(room.data());
    return room.data() + (alignment - address % alignment) % alignment / sizeof(T);
}

}  // namespace stymo::kernels
