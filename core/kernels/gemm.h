#pragma once

#include <bit>
#include <cstdint>
#include <memory>
#include <type_traits>

#include "core/op_options.h"

/// Matrix products on the calling thread, for the processor that runs them (Google Highway chooses
/// among instruction sets at run time). Every element of a result is one chain of fused
/// multiply-adds in the order of the inner index, or, on matrix tiles (core/matmul_precision.h), of
/// sums of two: it depends neither on the place of its block nor on the number of threads.
namespace stymo::kernels {

/// The upper half of a float32, rounded to nearest even.
struct BFloat16 {
    std::uint16_t bits = 0;
};

[[nodiscard]] inline float widened(BFloat16 x) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(x.bits) << 16);
}
/// A NaN stays one.
[[nodiscard]] inline BFloat16 rounded_to_bfloat16(float x) {
    const auto bits = std::bit_cast<std::uint32_t>(x);
    const std::uint32_t rounded = bits + 0x7FFF + (bits >> 16 & 1);
    const std::uint32_t quiet = bits | 0x400000;
    return {static_cast<std::uint16_t>((x == x ? rounded : quiet) >> 16)};
}

/// IEEE binary16.
struct Float16 {
    std::uint16_t bits = 0;
};
inline constexpr float largest_float16 = 65504.0F;

[[nodiscard]] float widened(Float16 x);
/// To nearest even. Beyond the largest number lies infinity; a NaN stays one.
[[nodiscard]] Float16 rounded_to_float16(float x);

template <class T>
inline constexpr bool has_sixteen_bits = std::is_same_v<T, BFloat16> || std::is_same_v<T, Float16>;

/// The right operand (k, n) of a product in the order in which a product reads it. Worth keeping
/// for several products. T: float, double, or BFloat16 or Float16 (packed from float, and rounded).
template <class T>
class PackedMatrix {
public:
    using Source = std::conditional_t<has_sixteen_bits<T>, float, T>;

    PackedMatrix() = default;
    /// Element (i, j) is b[i * inner_stride + j * column_stride], one of which is 1. A large matrix
    /// is packed by several threads.
    PackedMatrix(const Source* b, std::int64_t k, std::int64_t n, std::int64_t inner_stride,
                 std::int64_t column_stride);

    /// Views b as it stands, rows `inner_stride` apart, whose columns are a multiple of
    /// `panel_width()`: for products of so few rows that packing would not pay. Not of 16 bits; b
    /// must outlive the view.
    [[nodiscard]] static PackedMatrix in_place(const T* b, std::int64_t k, std::int64_t n,
                                               std::int64_t inner_stride);

    /// Views panels that are already in the order of `panel()`, one after the other; not of 16
    /// bits. They must outlive the view.
    [[nodiscard]] static PackedMatrix of_panels(const T* panels, std::int64_t k, std::int64_t n);
    /// Columns of a panel on this processor.
    [[nodiscard]] static std::int64_t usual_panel_width();

    [[nodiscard]] std::int64_t inner_length() const { return k_; }
    [[nodiscard]] std::int64_t columns() const { return n_; }
    [[nodiscard]] std::int64_t panel_width() const { return panel_width_; }
    [[nodiscard]] std::int64_t inner_stride() const { return inner_stride_; }
    /// All k rows of `panel_width` columns, `inner_stride()` apart; packed, they are 64-byte
    /// aligned, side by side, and zeros beyond column n. Of BFloat16, rows 2i and 2i + 1
    /// interleave, the last one with zeros if k is odd; the order of Float16 depends on the
    /// processor (core/kernels/float16_product.h).
    [[nodiscard]] const T* panel(std::int64_t index) const { return panels_ + index * panel_size_; }
    /// Parts of each number if panels are split for products on tiles (core/kernels/tile_split.h)
    /// and `panel()` may not be called, else 0; only float32 of less than MatmulPrecision::highest.
    [[nodiscard]] int parts() const { return parts_; }
    [[nodiscard]] const BFloat16* split_panel(std::int64_t index) const {
        return reinterpret_cast<const BFloat16*>(panel(index));
    }

private:
    std::int64_t k_ = 0;
    std::int64_t n_ = 0;
    std::int64_t panel_width_ = 0;
    std::int64_t inner_stride_ = 0;
    std::int64_t panel_size_ = 0;  ///< from one panel to the next
    int parts_ = 0;
    const T* panels_ = nullptr;
    std::shared_ptr<const T[]> storage_;  ///< never written again, so that copies may share it
};

/// Left operand (m, k): element (row, i) is data[row * row_stride + i * inner_stride]. One of the
/// strides is 1; of 16-bit types, the inner one.
template <class T>
struct LeftMatrix {
    const T* data;
    std::int64_t row_stride;
    std::int64_t inner_stride = 1;
};

/// What becomes of a product while it is still in registers: activation(product + bias or present
/// values).
template <class T>
struct Epilogue {
    const T* bias = nullptr;      ///< one number for each column
    bool present_values = false;  ///< added to the result's own values; then there is no bias
    Activation activation = Activation::none;
    T* slope = nullptr;  ///< where the derivative of the activation goes, rows as far apart as the
                         ///< result's; null: nowhere
};

/// c (m, n), rows `row_stride` apart, = epilogue(left * right).
template <class T>
void multiply_packed(T* c, std::int64_t row_stride, const LeftMatrix<T>& left, std::int64_t m,
                     const PackedMatrix<T>& right, const Epilogue<T>& epilogue = {});
/// BFloat16 operands, sums in float32; the result as float32, or rounded.
void multiply_packed(float* c, std::int64_t row_stride, const LeftMatrix<BFloat16>& left,
                     std::int64_t m, const PackedMatrix<BFloat16>& right,
                     const Epilogue<float>& epilogue = {});
void multiply_packed(BFloat16* c, std::int64_t row_stride, const LeftMatrix<BFloat16>& left,
                     std::int64_t m, const PackedMatrix<BFloat16>& right,
                     const Epilogue<float>& epilogue = {});
/// Float16 operands; the result as float32, or rounded. Sums in float32, or, with AVX-512-FP16, in
/// half precision over so few products that their errors stay below those of operands rounded to
/// BFloat16, and from there on in float32.
void multiply_packed(float* c, std::int64_t row_stride, const LeftMatrix<Float16>& left,
                     std::int64_t m, const PackedMatrix<Float16>& right,
                     const Epilogue<float>& epilogue = {});
void multiply_packed(Float16* c, std::int64_t row_stride, const LeftMatrix<Float16>& left,
                     std::int64_t m, const PackedMatrix<Float16>& right,
                     const Epilogue<float>& epilogue = {});

}  // namespace stymo::kernels
