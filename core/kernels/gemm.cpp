#include "core/kernels/gemm.h"

#include <algorithm>
#include <array>
#include <vector>

#include "core/kernels/targets.h"
#include "core/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/gemm.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/kernels/epilogue-inl.h"
#include "core/kernels/product-inl.h"

// Included once for each instruction set, so what does not depend on it stands below, within HWY_ONCE.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

/// Words of the inner index handled at once: a panel of the right operand (32 KiB with 512-bit vectors) stays in the first-level
/// cache.
constexpr std::int64_t inner_block = 256;
/// Rows handled at once: their part of the left operand stays in the second-level cache.
constexpr std::int64_t row_block = 240;

template <class T>
std::int64_t panel_width() {
    return 2 * static_cast<std::int64_t>(simd::Lanes(simd::ScalableTag<T>()));
}

template <class Operands>
constexpr std::int64_t most_columns = 2 * HWY_MAX_BYTES / static_cast<std::int64_t>(sizeof(typename Operands::Sum));

/// What a block of sums starts from where there is nothing.
template <class T>
constexpr std::array<T, 2 * HWY_MAX_BYTES / sizeof(T)> no_bias{};

template <class T>
T converted(T x) {
    return x;
}
inline float converted(BFloat16 x) {
    return widened(x);
}

/// A piece of the inner index for some rows of the left operand. Packed, blocks of `block_rows` rows follow each other, and in
/// them the words of all rows.
template <class Operands>
struct LeftPiece {
    using Element = typename Operands::Element;
    const Element* data;
    std::int64_t row_stride;
    std::int64_t inner_stride;
    std::int64_t block_stride;  ///< from a row to the one `block_rows` below
    std::int64_t words;

    [[nodiscard]] const Element* row(std::int64_t index) const {
        return data + index / block_rows * block_stride + index % block_rows * row_stride;
    }
};

/// Left operands whose words are not contiguous are copied, `buffer` being large enough.
template <class Operands>
LeftPiece<Operands> pack_left(typename Operands::Element* buffer, const LeftMatrix<typename Operands::Element>& left,
                              std::int64_t rows, std::int64_t elements) {
    constexpr std::int64_t length = Operands::word_length;
    const std::int64_t words = chunk_count(elements, length);
    const std::int64_t inner_stride = block_rows * length;
    const LeftPiece<Operands> piece{buffer, length, inner_stride, words * inner_stride, words};
    for (std::int64_t first = 0; first < rows; first += block_rows) {
        const std::int64_t count = std::min<std::int64_t>(block_rows, rows - first);
        typename Operands::Element* to = buffer + first * words * length;
        const typename Operands::Element* from = left.data + first * left.row_stride;
        if constexpr (length > 1) std::fill_n(to, words * inner_stride, typename Operands::Element());
        if (length == 1 && left.row_stride == 1 && count == block_rows) {
            for (std::int64_t i = 0; i < elements; ++i) {
                for (std::int64_t row = 0; row < block_rows; ++row) to[i * block_rows + row] = from[i * left.inner_stride + row];
            }
            continue;
        }
        for (std::int64_t i = 0; i < elements; ++i) {
            for (std::int64_t row = 0; row < count; ++row)
                to[i / length * inner_stride + row * length + i % length] = from[row * left.row_stride + i * left.inner_stride];
        }
    }
    return piece;
}

/// One panel of the right operand times some rows, for one piece of the inner index.
template <class Operands, class Out>
class PanelProduct {
public:
    using Sum = typename Operands::Sum;
    using Element = typename Operands::Element;

    PanelProduct(Out* c, std::int64_t stride, const Element* panel, std::int64_t columns, const Epilogue<Sum>& epilogue,
                 bool first_piece, bool last_piece)
        : c_(c),
          stride_(stride),
          panel_(panel),
          columns_(columns),
          slope_(epilogue.slope),
          activation_(epilogue.activation),
          adds_(epilogue.present_values || !first_piece),
          finishes_(last_piece),
          direct_(std::is_same_v<Out, Sum> && columns == panel_width<Sum>()) {
        if (epilogue.bias == nullptr) {
            bias_ = no_bias<Sum>.data();
        } else if (columns == panel_width<Sum>()) {
            bias_ = epilogue.bias;
        } else {
            std::copy_n(epilogue.bias, columns, padded_bias_.data());
            bias_ = padded_bias_.data();
        }
    }

    void multiply(const LeftPiece<Operands>& left, std::int64_t rows) {
        for (std::int64_t row = 0; row < rows;) {
            const int height = rows_of_next_block(rows - row);
            if (2 * columns_ <= panel_width<Sum>()) {
                multiply_rows<1>(left, row, height);
            } else {
                multiply_rows<2>(left, row, height);
            }
            row += height;
        }
    }

private:
    [[nodiscard]] bool activates() const { return finishes_ && (activation_ != Activation::none || slope_ != nullptr); }

    template <int vectors>
    HWY_INLINE void multiply_rows(const LeftPiece<Operands>& left, std::int64_t row, int height) {
        Out* const c = c_ + row * stride_;
        Block<Operands> block{bias_,  0,         sums_.data(), width, left.row(row), left.row_stride, left.inner_stride,
                              panel_, left.words};
        if constexpr (std::is_same_v<Out, Sum>) {
            if (direct_ && adds_) block.start = c, block.start_stride = stride_;
            if (direct_ && !activates()) block.sums = c, block.sums_stride = stride_;
        }
        if (adds_ && !direct_) {
            read_present_values(c, height);
            block.start = sums_.data();
            block.start_stride = width;
        }
        multiply_block_of<Operands, vectors>(height, block);
        if (block.sums == sums_.data()) finish<vectors>(c, row, height);
    }

    void read_present_values(const Out* c, int height) {
        for (int i = 0; i < height; ++i) {
            for (std::int64_t j = 0; j < columns_; ++j)
                sums_[static_cast<std::size_t>(i * width + j)] = converted(c[i * stride_ + j]);
        }
    }

    template <int vectors>
    HWY_INLINE void finish(Out* c, std::int64_t row, int height) {
        Sum* const slope = slope_ == nullptr || !finishes_ ? nullptr : slope_ + row * stride_;
        const Activation activation = finishes_ ? activation_ : Activation::none;
        const std::int64_t columns = vectors * panel_width<Sum>() / 2;
        if (columns_ == columns) {
            activate(Activated<Sum, Out>{sums_.data(), width, c, slope, stride_, height, columns}, activation);
            return;
        }
        std::array<Out, static_cast<std::size_t>(block_rows * width)> results;
        std::array<Sum, static_cast<std::size_t>(block_rows * width)> slopes;
        activate(Activated<Sum, Out>{sums_.data(), width, results.data(), slope == nullptr ? nullptr : slopes.data(), width,
                                     height, columns},
                 activation);
        for (int i = 0; i < height; ++i) {
            std::copy_n(results.data() + i * width, columns_, c + i * stride_);
            if (slope != nullptr) std::copy_n(slopes.data() + i * width, columns_, slope + i * stride_);
        }
    }

    static constexpr std::int64_t width = most_columns<Operands>;

    Out* c_;
    std::int64_t stride_;
    const Element* panel_;
    std::int64_t columns_;
    Sum* slope_;
    Activation activation_;
    bool adds_;      ///< to what c holds
    bool finishes_;  ///< the whole sum is there afterwards
    bool direct_;    ///< the panel's blocks fit c as they are
    const Sum* bias_;
    std::array<Sum, static_cast<std::size_t>(width)> padded_bias_{};
    alignas(HWY_MAX_BYTES) std::array<Sum, static_cast<std::size_t>(block_rows* width)> sums_{};
};

template <class Operands, class Out, class Element, class Sum>
void multiply(Out* c, std::int64_t stride, const LeftMatrix<Element>& left, std::int64_t m, const PackedMatrix<Element>& right,
              const Epilogue<Sum>& epilogue) {
    constexpr std::int64_t length = Operands::word_length;
    const std::int64_t k = right.inner_length();
    // Results that cannot hold a partial sum need all of it at once.
    const std::int64_t piece = std::is_same_v<Out, Sum> ? inner_block * length : std::max<std::int64_t>(k, 1);
    const bool packs = left.inner_stride != 1 || k % length != 0;
    std::vector<Element> packed;
    if (packs)
        packed.resize(static_cast<std::size_t>(chunk_count(std::min(m, row_block), block_rows) * block_rows *
                                               chunk_count(std::min(piece, k), length) * length));
    for (std::int64_t row = 0; row < m; row += row_block) {
        const std::int64_t rows = std::min(row_block, m - row);
        // At least once, so that an empty sum gets its epilogue.
        std::int64_t inner = 0;
        do {
            const std::int64_t elements = std::min(piece, k - inner);
            const LeftMatrix<Element> part{left.data + row * left.row_stride + inner * left.inner_stride, left.row_stride,
                                           left.inner_stride};
            const LeftPiece<Operands> words =
                packs ? pack_left<Operands>(packed.data(), part, rows, elements)
                      : LeftPiece<Operands>{part.data, part.row_stride, length, block_rows * part.row_stride, elements / length};
            for (std::int64_t column = 0; column < right.columns(); column += right.panel_width()) {
                Epilogue<Sum> of_columns = epilogue;
                if (epilogue.bias != nullptr) of_columns.bias += column;
                if (epilogue.slope != nullptr) of_columns.slope += row * stride + column;
                PanelProduct<Operands, Out>(
                    c + row * stride + column, stride, right.panel(column / right.panel_width()) + inner * right.panel_width(),
                    std::min(right.panel_width(), right.columns() - column), of_columns, inner == 0, inner + elements == k)
                    .multiply(words, rows);
            }
            inner += elements;
        } while (inner < k);
    }
}

void multiply_float(float* c, std::int64_t stride, const LeftMatrix<float>& left, std::int64_t m,
                    const PackedMatrix<float>& right, const Epilogue<float>& epilogue) {
    multiply<Numbers<float>>(c, stride, left, m, right, epilogue);
}

void multiply_double(double* c, std::int64_t stride, const LeftMatrix<double>& left, std::int64_t m,
                     const PackedMatrix<double>& right, const Epilogue<double>& epilogue) {
    multiply<Numbers<double>>(c, stride, left, m, right, epilogue);
}

template <class Out>
void multiply_pairs(Out* c, std::int64_t stride, const LeftMatrix<BFloat16>& left, std::int64_t m,
                    const PackedMatrix<BFloat16>& right, const Epilogue<float>& epilogue) {
    if (has_bfloat16_dot_product()) {
        multiply<Pairs<true>>(c, stride, left, m, right, epilogue);
    } else {
        multiply<Pairs<false>>(c, stride, left, m, right, epilogue);
    }
}

void multiply_pairs_to_float(float* c, std::int64_t stride, const LeftMatrix<BFloat16>& left, std::int64_t m,
                             const PackedMatrix<BFloat16>& right, const Epilogue<float>& epilogue) {
    multiply_pairs(c, stride, left, m, right, epilogue);
}

void multiply_pairs_to_bfloat16(BFloat16* c, std::int64_t stride, const LeftMatrix<BFloat16>& left, std::int64_t m,
                                const PackedMatrix<BFloat16>& right, const Epilogue<float>& epilogue) {
    multiply_pairs(c, stride, left, m, right, epilogue);
}

/// `rows` x `others` inner products of contiguous vectors.
template <class T, int rows, int others>
HWY_INLINE void multiply_dots_block(const Dots<T>& dots) {
    const simd::ScalableTag<T> tag;
    const std::int64_t lanes = static_cast<std::int64_t>(simd::Lanes(tag));
    simd::Vec<simd::ScalableTag<T>> sums[rows][others];
    HWY_UNROLL(4)
    for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < others; ++j) sums[i][j] = simd::Zero(tag);
    }
    const std::int64_t whole = dots.k / lanes * lanes;
    for (std::int64_t p = 0; p < whole; p += lanes) {
        simd::Vec<simd::ScalableTag<T>> y[others];
        for (int j = 0; j < others; ++j) y[j] = simd::LoadU(tag, dots.y + j * dots.k + p);
        HWY_UNROLL(4)
        for (int i = 0; i < rows; ++i) {
            const auto x = simd::LoadU(tag, dots.x + i * dots.k + p);
            for (int j = 0; j < others; ++j) sums[i][j] = simd::MulAdd(x, y[j], sums[i][j]);
        }
    }
    HWY_UNROLL(4)
    for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < others; ++j) {
            T sum = simd::GetLane(simd::SumOfLanes(tag, sums[i][j]));
            for (std::int64_t p = whole; p < dots.k; ++p) sum += dots.x[i * dots.k + p] * dots.y[j * dots.k + p];
            dots.c[i * dots.stride_x + j * dots.stride_y] = sum;
        }
    }
}

template <class T, int others>
void multiply_dots_with(Dots<T> dots) {
    const auto advance = [&](std::int64_t rows) {
        dots.x += rows * dots.k;
        dots.c += rows * dots.stride_x;
        dots.count_x -= rows;
    };
    for (; dots.count_x >= 4; advance(4)) multiply_dots_block<T, 4, others>(dots);
    for (; dots.count_x > 0; advance(1)) multiply_dots_block<T, 1, others>(dots);
}

template <class T>
void multiply_dots_of(Dots<T> dots) {
    while (dots.count_y > 0) {
        const std::int64_t others = dots.count_y > 3 ? 4 : dots.count_y;
        if (others == 4) multiply_dots_with<T, 4>(dots);
        if (others == 3) multiply_dots_with<T, 3>(dots);
        if (others == 2) multiply_dots_with<T, 2>(dots);
        if (others == 1) multiply_dots_with<T, 1>(dots);
        dots.y += others * dots.k;
        dots.c += others * dots.stride_y;
        dots.count_y -= others;
    }
}

void multiply_float_dots(const Dots<float>& dots) {
    multiply_dots_of(dots);
}

void multiply_double_dots(const Dots<double>& dots) {
    multiply_dots_of(dots);
}

std::int64_t panel_bytes() {
    return panel_width<float>() * static_cast<std::int64_t>(sizeof(float));
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace stymo::kernels {

HWY_EXPORT(multiply_float);
HWY_EXPORT(multiply_double);
HWY_EXPORT(multiply_pairs_to_float);
HWY_EXPORT(multiply_pairs_to_bfloat16);
HWY_EXPORT(multiply_float_dots);
HWY_EXPORT(multiply_double_dots);
HWY_EXPORT(panel_bytes);

namespace {

/// Elements that are worth a thread's while to pack.
constexpr std::int64_t packing_grain = 65536;
/// Alignment of panels, in bytes.
constexpr std::uintptr_t alignment = 64;

/// One panel: element (i, j) of `columns` columns.
template <class T>
void pack_panel(T* to, const T* from, std::int64_t k, std::int64_t columns, std::int64_t width, std::int64_t inner_stride,
                std::int64_t column_stride) {
    for (std::int64_t i = 0; i < k; ++i) {
        T* const row = to + i * width;
        const T* const source = from + i * inner_stride;
        if (column_stride == 1) {
            for (std::int64_t j = 0; j < columns; ++j) row[j] = source[j];
        } else {
            for (std::int64_t j = 0; j < columns; ++j) row[j] = source[j * column_stride];
        }
        for (std::int64_t j = columns; j < width; ++j) row[j] = T(0);
    }
}

void pack_panel(BFloat16* to, const float* from, std::int64_t k, std::int64_t columns, std::int64_t width,
                std::int64_t inner_stride, std::int64_t column_stride) {
    std::fill_n(to, chunk_count(k, 2) * 2 * width, BFloat16());
    for (std::int64_t i = 0; i < k; ++i) {
        for (std::int64_t j = 0; j < columns; ++j)
            to[i / 2 * 2 * width + 2 * j + i % 2] = rounded_to_bfloat16(from[i * inner_stride + j * column_stride]);
    }
}

}  // namespace

template <class T>
PackedMatrix<T>::PackedMatrix(const Source* b, std::int64_t k, std::int64_t n, std::int64_t inner_stride,
                              std::int64_t column_stride)
    : k_(k), n_(n), panel_width_(HWY_DYNAMIC_DISPATCH(panel_bytes)() / static_cast<std::int64_t>(sizeof(Source))) {
    constexpr std::int64_t word_length = std::is_same_v<T, BFloat16> ? 2 : 1;
    panel_size_ = chunk_count(k, word_length) * word_length * panel_width_;
    const std::int64_t count = chunk_count(n, panel_width_);
    const std::shared_ptr<T[]> storage =
        std::make_shared_for_overwrite<T[]>(static_cast<std::size_t>(count * panel_size_) + alignment / sizeof(T));
    const auto address = reinterpret_cast<std::uintptr_t>(storage.get());
    T* const panels = storage.get() + (alignment - address % alignment) % alignment / sizeof(T);
    const std::int64_t grain = std::max<std::int64_t>(1, packing_grain / std::max<std::int64_t>(1, panel_size_));
    parallel_for(count, grain, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t index = begin; index < end; ++index) {
            const std::int64_t first = index * panel_width_;
            pack_panel(panels + index * panel_size_, b + first * column_stride, k, std::min(panel_width_, n - first),
                       panel_width_, inner_stride, column_stride);
        }
    });
    panels_ = panels;
    storage_ = storage;
}

template class PackedMatrix<float>;
template class PackedMatrix<double>;
template class PackedMatrix<BFloat16>;

template <>
void multiply_packed(float* c, std::int64_t row_stride, const LeftMatrix<float>& left, std::int64_t m,
                     const PackedMatrix<float>& right, const Epilogue<float>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_float)(c, row_stride, left, m, right, epilogue);
}

template <>
void multiply_packed(double* c, std::int64_t row_stride, const LeftMatrix<double>& left, std::int64_t m,
                     const PackedMatrix<double>& right, const Epilogue<double>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_double)(c, row_stride, left, m, right, epilogue);
}

void multiply_packed(float* c, std::int64_t row_stride, const LeftMatrix<BFloat16>& left, std::int64_t m,
                     const PackedMatrix<BFloat16>& right, const Epilogue<float>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_pairs_to_float)(c, row_stride, left, m, right, epilogue);
}

void multiply_packed(BFloat16* c, std::int64_t row_stride, const LeftMatrix<BFloat16>& left, std::int64_t m,
                     const PackedMatrix<BFloat16>& right, const Epilogue<float>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_pairs_to_bfloat16)(c, row_stride, left, m, right, epilogue);
}

template <>
void multiply_dots(const Dots<float>& dots) {
    HWY_DYNAMIC_DISPATCH(multiply_float_dots)(dots);
}

template <>
void multiply_dots(const Dots<double>& dots) {
    HWY_DYNAMIC_DISPATCH(multiply_double_dots)(dots);
}

}  // namespace stymo::kernels
#endif
