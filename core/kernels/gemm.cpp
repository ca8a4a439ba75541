#include "core/kernels/gemm.h"

#include <algorithm>
#include <array>
#include <vector>

#include "core/kernels/scratch.h"
#include "core/kernels/targets.h"
#include "core/kernels/tile_product.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/gemm.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/kernels/epilogue-inl.h"
#include "core/kernels/gemm_tiles-inl.h"
#include "core/kernels/product-inl.h"

// This file is compiled once for each instruction set. Code that does not depend on it is below,
// within HWY_ONCE.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

/// Words of the inner index handled at once: a panel of the right operand (32 KiB with 512-bit
/// vectors) stays in the first-level cache.
constexpr std::int64_t inner_block = 256;
/// Largest number of columns for which a transposed left operand is not copied.
constexpr std::int64_t most_unpacked = 64;
/// Bytes of the left operand's and the result's rows that are handled at once: they stay in the
/// second-level cache.
constexpr std::int64_t row_block_bytes = 1 << 19;

template <class Sum>
std::int64_t row_block(std::int64_t k, std::int64_t n) {
    const std::int64_t bytes =
        (std::min(k, inner_block) + n) * static_cast<std::int64_t>(sizeof(Sum));
    const std::int64_t in_cache = row_block_bytes / std::max<std::int64_t>(1, bytes) / block_rows;
    return std::clamp<std::int64_t>(in_cache, 1, 20) * block_rows;
}

template <class T>
std::int64_t panel_width() {
    return 2 * static_cast<std::int64_t>(simd::Lanes(simd::ScalableTag<T>()));
}

template <class Operands>
constexpr std::int64_t most_columns = 2 * HWY_MAX_BYTES /
                                      static_cast<std::int64_t>(sizeof(typename Operands::Sum));

/// Initial values of a block of sums without bias and present values.
template <class T>
constexpr std::array<T, 2 * HWY_MAX_BYTES / sizeof(T)> no_bias{};

template <class T>
T converted(T x) {
    return x;
}
inline float converted(BFloat16 x) {
    return widened(x);
}
inline float converted(Float16 x) {
    return widened(x);
}

/// A piece of the inner index for some rows of the left operand. Copies may have blocks of
/// `block_rows` rows one after the other, and in them the words of all rows.
template <class Operands>
struct LeftPiece {
    using Left = typename Operands::Left;
    const Left* data;
    std::int64_t row_stride;
    std::int64_t inner_stride;
    std::int64_t block_stride;  ///< from a row to the one `block_rows` below
    std::int64_t words;

    [[nodiscard]] const Left* row(std::int64_t index) const {
        return data + index / block_rows * block_stride + index % block_rows * row_stride;
    }
};

/// A copy of a left operand whose inner index is not contiguous; `buffer` is large enough.
template <class T>
LeftPiece<Numbers<T>> copy_left(T* buffer, const LeftMatrix<T>& left, std::int64_t rows,
                                std::int64_t words) {
    // If the rows of the transpose are contiguous, each is read once, from one end to the other.
    const std::int64_t whole = left.row_stride == 1 ? rows / block_rows * block_rows : 0;
    for (std::int64_t i = 0; whole > 0 && i < words; ++i) {
        const T* const from = left.data + i * left.inner_stride;
        for (std::int64_t first = 0; first < whole; first += block_rows) {
            for (std::int64_t row = 0; row < block_rows; ++row)
                buffer[first * words + i * block_rows + row] = from[first + row];
        }
    }
    for (std::int64_t first = whole; first < rows; first += block_rows) {
        const std::int64_t count = std::min<std::int64_t>(block_rows, rows - first);
        const T* const from = left.data + first * left.row_stride;
        for (std::int64_t i = 0; i < words; ++i) {
            for (std::int64_t row = 0; row < count; ++row)
                buffer[first * words + i * block_rows + row] =
                    from[row * left.row_stride + i * left.inner_stride];
        }
    }
    return {buffer, 1, block_rows, words * block_rows, words};
}

/// Row by row; an incomplete last word is filled up with a zero.
template <class Operands>
LeftPiece<Operands> copy_rows(typename Operands::Left* buffer,
                              const LeftMatrix<typename Operands::Element>& left, std::int64_t rows,
                              std::int64_t elements) {
    using Left = typename Operands::Left;
    const std::int64_t words = chunk_count(elements, Operands::word_length);
    const std::int64_t row_stride = words * Operands::word_length;
    for (std::int64_t row = 0; row < rows; ++row) {
        const auto* const from = left.data + row * left.row_stride;
        Left* const to = buffer + row * row_stride;
        if constexpr (std::is_same_v<Left, typename Operands::Element>) {
            std::copy_n(from, elements, to);
        } else {
            for (std::int64_t i = 0; i < elements; ++i) to[i] = widened(from[i]);
        }
        if (elements < row_stride) to[elements] = Left();
    }
    return {buffer, row_stride, Operands::word_length, block_rows * row_stride, words};
}

/// One panel of the right operand times some rows, for one piece of the inner index.
template <class Operands, class Out>
class PanelProduct {
public:
    using Sum = typename Operands::Sum;
    using Element = typename Operands::Element;

    PanelProduct(Out* c, std::int64_t stride, const Element* panel, const Element* next_panel,
                 std::int64_t panel_stride, std::int64_t columns, const Epilogue<Sum>& epilogue,
                 bool first_piece, bool last_piece)
        : c_(c),
          stride_(stride),
          panel_(panel),
          next_panel_(next_panel),
          panel_stride_(panel_stride),
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
            padded_bias_.fill(Sum(0));
            std::copy_n(epilogue.bias, columns, padded_bias_.data());
            bias_ = padded_bias_.data();
        }
    }

    void multiply(const LeftPiece<Operands>& left, std::int64_t rows) {
        for (std::int64_t row = 0; row < rows;) {
            const int height = rows_of_next_block(rows - row);
            if (!std::is_same_v<Operands, HalfPairs> && 2 * columns_ <= panel_width<Sum>()) {
                multiply_rows<1>(left, row, height);
            } else {
                multiply_rows<2>(left, row, height);
            }
            row += height;
        }
    }

private:
    [[nodiscard]] bool activates() const {
        return finishes_ && (activation_ != Activation::none || slope_ != nullptr);
    }

    /// Whether the sums are short enough for half precision, and the epilogue needs no more.
    [[nodiscard]] bool stays_half(std::int64_t words) const {
        return words <= float16_pairs_at_once && columns_ == float16_columns && !adds_ &&
               finishes_ && slope_ == nullptr && activation_ != Activation::sine;
    }

    template <int vectors>
    HWY_INLINE void multiply_rows(const LeftPiece<Operands>& left, std::int64_t row, int height) {
        Out* const c = c_ + row * stride_;
        if constexpr (std::is_same_v<Operands, HalfPairs> && std::is_same_v<Out, Element>) {
            if (stays_half(left.words)) {
                multiply_float16_layer(
                    height, {{left.row(row), left.row_stride, panel_, panel_stride_, left.words},
                             bias_,
                             activation_ == Activation::leaky_relu,
                             c,
                             stride_});
                return;
            }
        }
        Block<Operands> block{bias_,
                              0,
                              sums_.data(),
                              width,
                              left.row(row),
                              left.row_stride,
                              left.inner_stride,
                              panel_,
                              panel_stride_,
                              left.words,
                              part_of_next_panel(row, left.words)};
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

    /// The part that the block at this row prefetches; all blocks together fetch the whole panel.
    [[nodiscard]] const char* part_of_next_panel(std::int64_t row, std::int64_t words) const {
        const std::int64_t size =
            words * panel_stride_ * static_cast<std::int64_t>(sizeof(Element));
        const std::int64_t share = words / words_of_prefetch * bytes_of_prefetch;
        const std::int64_t begin = row / block_rows * share;
        return reinterpret_cast<const char*>(next_panel_) + (begin + share <= size ? begin : 0);
    }

    void read_present_values(const Out* c, int height) {
        for (int i = 0; i < height; ++i) {
            Sum* const row = sums_.data() + i * width;
            for (std::int64_t j = 0; j < columns_; ++j) row[j] = converted(c[i * stride_ + j]);
            std::fill(row + columns_, row + width, Sum(0));
        }
    }

    template <int vectors>
    HWY_INLINE void finish(Out* c, std::int64_t row, int height) {
        Sum* const slope = slope_ == nullptr || !finishes_ ? nullptr : slope_ + row * stride_;
        const Activation activation = finishes_ ? activation_ : Activation::none;
        finish_block<block_rows, width>(
            Activated<Sum, Out>{sums_.data(), width, c, slope, stride_, height, columns_},
            vectors * panel_width<Sum>() / 2, activation);
    }

    static constexpr std::int64_t width = most_columns<Operands>;

    Out* c_;
    std::int64_t stride_;
    const Element* panel_;
    const Element* next_panel_;  ///< this one if it is the last
    std::int64_t panel_stride_;  ///< between words
    std::int64_t columns_;
    Sum* slope_;
    Activation activation_;
    bool adds_;      ///< adds the product to the values in c
    bool finishes_;  ///< the sum is complete afterwards
    bool direct_;    ///< the panel's blocks can use c directly
    const Sum* bias_;
    std::array<Sum, static_cast<std::size_t>(width)> padded_bias_;
    alignas(HWY_MAX_BYTES) std::array<Sum, static_cast<std::size_t>(block_rows* width)> sums_{};
};

template <class Operands, class Out, class Element, class Sum>
void multiply(Out* c, std::int64_t stride, const LeftMatrix<Element>& left, std::int64_t m,
              const PackedMatrix<Element>& right, const Epilogue<Sum>& epilogue) {
    constexpr std::int64_t length = Operands::word_length;
    const std::int64_t k = right.inner_length();
    // Results of 16 bits cannot hold partial sums, so they need the whole sum at once.
    const std::int64_t piece =
        std::is_same_v<Out, Sum> ? inner_block * length : std::max<std::int64_t>(k, 1);
    const std::int64_t most_rows = row_block<Sum>(k, right.columns());
    constexpr bool widens = !std::is_same_v<typename Operands::Left, Element>;
    // Copying pays if several panels read the copy.
    const bool copies =
        widens || k % length != 0 ||
        (left.inner_stride != 1 && (left.row_stride != 1 || right.columns() > most_unpacked));
    typename Operands::Left* copy = nullptr;
    if (copies) {
        const std::int64_t rows = chunk_count(std::min(m, most_rows), block_rows) * block_rows;
        copy = scratch_of_thread<typename Operands::Left>(
            static_cast<std::size_t>(rows * chunk_count(std::min(piece, k), length) * length));
    }
    for (std::int64_t row = 0; row < m; row += most_rows) {
        const std::int64_t rows = std::min(most_rows, m - row);
        // At least once, so that an empty sum gets its epilogue.
        std::int64_t inner = 0;
        do {
            const std::int64_t elements = std::min(piece, k - inner);
            const LeftMatrix<Element> part{
                left.data + row * left.row_stride + inner * left.inner_stride, left.row_stride,
                left.inner_stride};
            const LeftPiece<Operands> words = [&] {
                if constexpr (!widens) {
                    if (!copies)
                        return LeftPiece<Operands>{part.data, part.row_stride,
                                                   part.inner_stride * length,
                                                   block_rows * part.row_stride, elements / length};
                }
                if constexpr (has_sixteen_bits<Element>) {
                    return copy_rows<Operands>(copy, part, rows, elements);
                } else {
                    return copy_left(copy, part, rows, elements);
                }
            }();
            for (std::int64_t column = 0; column < right.columns(); column += right.panel_width()) {
                Epilogue<Sum> of_columns = epilogue;
                if (epilogue.bias != nullptr) of_columns.bias += column;
                if (epilogue.slope != nullptr) of_columns.slope += row * stride + column;
                const std::int64_t index = column / right.panel_width(),
                                   first = inner * right.inner_stride();
                const bool last = column + right.panel_width() >= right.columns();
                PanelProduct<Operands, Out>(
                    c + row * stride + column, stride, right.panel(index) + first,
                    right.panel(last ? index : index + 1) + first, right.inner_stride() * length,
                    std::min(right.panel_width(), right.columns() - column), of_columns, inner == 0,
                    inner + elements == k)
                    .multiply(words, rows);
            }
            inner += elements;
        } while (inner < k);
    }
}

void multiply_float(float* c, std::int64_t stride, const LeftMatrix<float>& left, std::int64_t m,
                    const PackedMatrix<float>& right, const Epilogue<float>& epilogue) {
    if constexpr (HWY_MAX_BYTES == 64) {
        const int parts = right.parts() > 0 ? right.parts()
                                            : tile_parts(right.inner_length(), right.panel_width());
        if (parts > 0) {
            multiply_in_tiles(parts, c, stride, left, m, right, epilogue);
            return;
        }
    }
    multiply<Numbers<float>>(c, stride, left, m, right, epilogue);
}

void multiply_double(double* c, std::int64_t stride, const LeftMatrix<double>& left, std::int64_t m,
                     const PackedMatrix<double>& right, const Epilogue<double>& epilogue) {
    multiply<Numbers<double>>(c, stride, left, m, right, epilogue);
}

template <class Out>
void multiply_pairs(Out* c, std::int64_t stride, const LeftMatrix<BFloat16>& left, std::int64_t m,
                    const PackedMatrix<BFloat16>& right, const Epilogue<float>& epilogue) {
    multiply<Pairs>(c, stride, left, m, right, epilogue);
}

void multiply_pairs_to_float(float* c, std::int64_t stride, const LeftMatrix<BFloat16>& left,
                             std::int64_t m, const PackedMatrix<BFloat16>& right,
                             const Epilogue<float>& epilogue) {
    multiply_pairs(c, stride, left, m, right, epilogue);
}

void multiply_pairs_to_bfloat16(BFloat16* c, std::int64_t stride, const LeftMatrix<BFloat16>& left,
                                std::int64_t m, const PackedMatrix<BFloat16>& right,
                                const Epilogue<float>& epilogue) {
    multiply_pairs(c, stride, left, m, right, epilogue);
}

template <class Out>
void multiply_halves(Out* c, std::int64_t stride, const LeftMatrix<Float16>& left, std::int64_t m,
                     const PackedMatrix<Float16>& right, const Epilogue<float>& epilogue) {
    if constexpr (HWY_MAX_BYTES == 64) {
        if (multiplies_float16()) {
            multiply<HalfPairs>(c, stride, left, m, right, epilogue);
            return;
        }
    }
    multiply<Halves>(c, stride, left, m, right, epilogue);
}

void multiply_halves_to_float(float* c, std::int64_t stride, const LeftMatrix<Float16>& left,
                              std::int64_t m, const PackedMatrix<Float16>& right,
                              const Epilogue<float>& epilogue) {
    multiply_halves(c, stride, left, m, right, epilogue);
}

void multiply_halves_to_float16(Float16* c, std::int64_t stride, const LeftMatrix<Float16>& left,
                                std::int64_t m, const PackedMatrix<Float16>& right,
                                const Epilogue<float>& epilogue) {
    multiply_halves(c, stride, left, m, right, epilogue);
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
HWY_EXPORT(multiply_halves_to_float);
HWY_EXPORT(multiply_halves_to_float16);
HWY_EXPORT(panel_bytes);

namespace {

constexpr std::int64_t packing_grain = 65536;  ///< smallest number of elements that a thread packs
constexpr std::uintptr_t alignment = 64;       ///< of panels, in bytes

/// Panels of b, each `width` columns, that begin with column 0.
template <class T>
struct Panels {
    T* to;
    std::int64_t k;
    std::int64_t width;
    std::int64_t size;  ///< of one panel
};

/// For contiguous rows: each row is read once, from one end to the other.
template <class T>
void pack_rows(const Panels<T>& panels, const T* from, std::int64_t columns,
               std::int64_t inner_stride) {
    for (std::int64_t i = 0; i < panels.k; ++i, from += inner_stride) {
        T* to = panels.to + i * panels.width;
        std::int64_t first = 0;
        for (; first + panels.width <= columns; first += panels.width, to += panels.size) {
            for (std::int64_t j = 0; j < panels.width; ++j) to[j] = from[first + j];
        }
        for (std::int64_t j = first; j < columns; ++j) to[j - first] = from[j];
        if (first < columns) std::fill(to + columns - first, to + panels.width, T(0));
    }
}

template <class T>
void pack_panel(T* to, const T* from, std::int64_t k, std::int64_t columns, std::int64_t width,
                std::int64_t inner_stride, std::int64_t column_stride) {
    // One cache line of each column at a time: columns a power of two apart would evict one
    // another.
    constexpr std::int64_t line = alignment / sizeof(T);
    for (std::int64_t first = 0; first < k; first += line) {
        const std::int64_t last = std::min(k, first + line);
        if (column_stride == 1) {
            for (std::int64_t i = first; i < last; ++i)
                std::copy_n(from + i * inner_stride, columns, to + i * width);
        } else {
            for (std::int64_t j = 0; j < columns; ++j) {
                for (std::int64_t i = first; i < last; ++i)
                    to[i * width + j] = from[i * inner_stride + j * column_stride];
            }
        }
        for (std::int64_t i = first; i < last; ++i)
            std::fill(to + i * width + columns, to + (i + 1) * width, T(0));
    }
}

void pack_panel(BFloat16* to, const float* from, std::int64_t k, std::int64_t columns,
                std::int64_t width, std::int64_t inner_stride, std::int64_t column_stride) {
    std::fill_n(to, chunk_count(k, 2) * 2 * width, BFloat16());
    for (std::int64_t i = 0; i < k; ++i) {
        for (std::int64_t j = 0; j < columns; ++j)
            to[i / 2 * 2 * width + 2 * j + i % 2] =
                rounded_to_bfloat16(from[i * inner_stride + j * column_stride]);
    }
}

void pack_panel(Float16* to, const float* from, std::int64_t k, std::int64_t columns,
                std::int64_t width, std::int64_t inner_stride, std::int64_t column_stride) {
    std::fill_n(to, chunk_count(k, 2) * 2 * width, Float16());
    const bool in_pairs = width == float16_columns && multiplies_float16();
    for (std::int64_t i = 0; i < k; ++i) {
        for (std::int64_t j = 0; j < columns; ++j)
            to[in_pairs ? float16_panel_index(i, j) : i * width + j] =
                rounded_to_float16(from[i * inner_stride + j * column_stride]);
    }
}

template <class T>
std::int64_t panel_width_of() {
    return HWY_DYNAMIC_DISPATCH(panel_bytes)() / static_cast<std::int64_t>(sizeof(T));
}

}  // namespace

template <class T>
PackedMatrix<T>::PackedMatrix(const Source* b, std::int64_t k, std::int64_t n,
                              std::int64_t inner_stride, std::int64_t column_stride)
    : k_(k), n_(n), panel_width_(panel_width_of<Source>()), inner_stride_(panel_width_) {
    constexpr std::int64_t word_length = has_sixteen_bits<T> ? 2 : 1;
    panel_size_ = chunk_count(k, word_length) * word_length * panel_width_;
    if constexpr (std::is_same_v<T, float>) {
        parts_ = tile_parts(k, panel_width_);
        if (parts_ > 0)
            panel_size_ = chunk_count(k, tile_step) * tile_step * panel_width_ * parts_ / 2;
    }
    const std::int64_t count = chunk_count(n, panel_width_);
    const std::shared_ptr<T[]> storage = std::make_shared_for_overwrite<T[]>(
        static_cast<std::size_t>(count * panel_size_) + alignment / sizeof(T));
    const auto address = reinterpret_cast<std::uintptr_t>(storage.get());
    T* const panels = storage.get() + (alignment - address % alignment) % alignment / sizeof(T);
    const std::int64_t grain =
        std::max<std::int64_t>(1, packing_grain / std::max<std::int64_t>(1, panel_size_));
    parallel_for(count, grain, [&](std::int64_t begin, std::int64_t end) {
        if constexpr (std::is_same_v<T, float>) {
            for (std::int64_t i = begin; parts_ > 0 && i < end; ++i)
                split_right(parts_, reinterpret_cast<BFloat16*>(panels + i * panel_size_),
                            b + i * panel_width_ * column_stride, k,
                            std::min(panel_width_, n - i * panel_width_), inner_stride,
                            column_stride);
            if (parts_ > 0) return;
        }
        if constexpr (std::is_same_v<T, Source>) {
            if (column_stride == 1) {
                pack_rows(Panels<T>{panels + begin * panel_size_, k, panel_width_, panel_size_},
                          b + begin * panel_width_,
                          std::min(n, end * panel_width_) - begin * panel_width_, inner_stride);
                return;
            }
        }
        for (std::int64_t index = begin; index < end; ++index) {
            const std::int64_t first = index * panel_width_;
            pack_panel(panels + index * panel_size_, b + first * column_stride, k,
                       std::min(panel_width_, n - first), panel_width_, inner_stride,
                       column_stride);
        }
    });
    panels_ = panels;
    storage_ = storage;
}

template <class T>
PackedMatrix<T> PackedMatrix<T>::in_place(const T* b, std::int64_t k, std::int64_t n,
                                          std::int64_t inner_stride) {
    PackedMatrix view;
    view.k_ = k;
    view.n_ = n;
    view.panel_width_ = view.panel_size_ = panel_width_of<Source>();
    view.inner_stride_ = inner_stride;
    view.panels_ = b;
    return view;
}

template <class T>
PackedMatrix<T> PackedMatrix<T>::of_panels(const T* panels, std::int64_t k, std::int64_t n) {
    PackedMatrix view = in_place(panels, k, n, usual_panel_width());
    view.panel_size_ = k * view.panel_width_;
    return view;
}

template <class T>
std::int64_t PackedMatrix<T>::usual_panel_width() {
    return panel_width_of<Source>();
}

template class PackedMatrix<float>;
template class PackedMatrix<double>;
template class PackedMatrix<BFloat16>;
template class PackedMatrix<Float16>;

namespace {

/// The product of float32 with operands that are rounded to BFloat16.
void multiply_rounded(float* c, std::int64_t row_stride, const LeftMatrix<float>& left,
                      std::int64_t m, const PackedMatrix<float>& right,
                      const Epilogue<float>& epilogue) {
    const auto rounded = [](float x) { return widened(rounded_to_bfloat16(x)); };
    const std::int64_t k = right.inner_length(), width = right.panel_width();
    std::vector<float> rows, panels;
    for (std::int64_t row = 0; row < m; ++row) {
        for (std::int64_t i = 0; i < k; ++i)
            rows.push_back(rounded(left.data[row * left.row_stride + i * left.inner_stride]));
    }
    for (std::int64_t panel = 0; panel < chunk_count(right.columns(), width); ++panel) {
        for (std::int64_t i = 0; i < k * width; ++i)
            panels.push_back(
                rounded(right.panel(panel)[i / width * right.inner_stride() + i % width]));
    }
    HWY_DYNAMIC_DISPATCH(multiply_float)
    (c, row_stride, {rows.data(), k}, m,
     PackedMatrix<float>::of_panels(panels.data(), k, right.columns()), epilogue);
}

}  // namespace

template <>
void multiply_packed(float* c, std::int64_t row_stride, const LeftMatrix<float>& left,
                     std::int64_t m, const PackedMatrix<float>& right,
                     const Epilogue<float>& epilogue) {
    if (emulates_medium() && lowers_precision(right.inner_length()))
        return multiply_rounded(c, row_stride, left, m, right, epilogue);
    HWY_DYNAMIC_DISPATCH(multiply_float)(c, row_stride, left, m, right, epilogue);
}

template <>
void multiply_packed(double* c, std::int64_t row_stride, const LeftMatrix<double>& left,
                     std::int64_t m, const PackedMatrix<double>& right,
                     const Epilogue<double>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_double)(c, row_stride, left, m, right, epilogue);
}

void multiply_packed(float* c, std::int64_t row_stride, const LeftMatrix<BFloat16>& left,
                     std::int64_t m, const PackedMatrix<BFloat16>& right,
                     const Epilogue<float>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_pairs_to_float)(c, row_stride, left, m, right, epilogue);
}

void multiply_packed(BFloat16* c, std::int64_t row_stride, const LeftMatrix<BFloat16>& left,
                     std::int64_t m, const PackedMatrix<BFloat16>& right,
                     const Epilogue<float>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_pairs_to_bfloat16)(c, row_stride, left, m, right, epilogue);
}

void multiply_packed(float* c, std::int64_t row_stride, const LeftMatrix<Float16>& left,
                     std::int64_t m, const PackedMatrix<Float16>& right,
                     const Epilogue<float>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_halves_to_float)(c, row_stride, left, m, right, epilogue);
}

void multiply_packed(Float16* c, std::int64_t row_stride, const LeftMatrix<Float16>& left,
                     std::int64_t m, const PackedMatrix<Float16>& right,
                     const Epilogue<float>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_halves_to_float16)(c, row_stride, left, m, right, epilogue);
}

}  // namespace stymo::kernels
#endif
