#include "core/kernels/gemm.h"

#include <algorithm>
#include <array>

#include "core/kernels/targets.h"
#include "core/kernels/tile_product.h"
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

/// Elements of the inner index handled at once: a panel of the right operand (32 KiB with 512-bit
/// vectors) stays in the first-level cache.
constexpr std::int64_t inner_block = 256;
/// Largest number of columns for which a transposed left operand is not copied.
constexpr std::int64_t most_unpacked = 64;
/// Bytes of the left operand's and the result's rows that are handled at once: they stay in the
/// second-level cache.
constexpr std::int64_t row_block_bytes = 1 << 19;

template <class T>
std::int64_t row_block(std::int64_t k, std::int64_t n) {
    const std::int64_t bytes =
        (std::min(k, inner_block) + n) * static_cast<std::int64_t>(sizeof(T));
    const std::int64_t in_cache = row_block_bytes / std::max<std::int64_t>(1, bytes) / block_rows;
    return std::clamp<std::int64_t>(in_cache, 1, 20) * block_rows;
}

template <class T>
std::int64_t panel_width() {
    return 2 * static_cast<std::int64_t>(simd::Lanes(simd::ScalableTag<T>()));
}

template <class T>
constexpr std::int64_t most_columns = 2 * HWY_MAX_BYTES / static_cast<std::int64_t>(sizeof(T));

/// Initial values of a block of sums without bias and present values.
template <class T>
constexpr std::array<T, 2 * HWY_MAX_BYTES / sizeof(T)> no_bias{};

/// A piece of the inner index for some rows of the left operand. Copies may have blocks of
/// `block_rows` rows one after the other, and in them the elements of all rows.
template <class T>
struct LeftPiece {
    const T* data;
    std::int64_t row_stride;
    std::int64_t inner_stride;
    std::int64_t block_stride;  ///< from a row to the one `block_rows` below
    std::int64_t elements;

    [[nodiscard]] const T* row(std::int64_t index) const {
        return data + index / block_rows * block_stride + index % block_rows * row_stride;
    }
};

/// A copy of a left operand whose inner index is not contiguous; `buffer` is large enough.
template <class T>
LeftPiece<T> copy_left(T* buffer, const LeftMatrix<T>& left, std::int64_t rows,
                       std::int64_t elements) {
    // If the rows of the transpose are contiguous, each is read once, from one end to the other.
    const std::int64_t whole = left.row_stride == 1 ? rows / block_rows * block_rows : 0;
    for (std::int64_t i = 0; whole > 0 && i < elements; ++i) {
        const T* const from = left.data + i * left.inner_stride;
        for (std::int64_t first = 0; first < whole; first += block_rows) {
            for (std::int64_t row = 0; row < block_rows; ++row)
                buffer[first * elements + i * block_rows + row] = from[first + row];
        }
    }
    for (std::int64_t first = whole; first < rows; first += block_rows) {
        const std::int64_t count = std::min<std::int64_t>(block_rows, rows - first);
        const T* const from = left.data + first * left.row_stride;
        for (std::int64_t i = 0; i < elements; ++i) {
            for (std::int64_t row = 0; row < count; ++row)
                buffer[first * elements + i * block_rows + row] =
                    from[row * left.row_stride + i * left.inner_stride];
        }
    }
    return {buffer, 1, block_rows, elements * block_rows, elements};
}

/// One panel of the right operand times some rows, for one piece of the inner index.
template <class T>
class PanelProduct {
public:
    PanelProduct(T* c, std::int64_t stride, const T* panel, const T* next_panel,
                 std::int64_t panel_stride, std::int64_t columns, const Epilogue<T>& epilogue,
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
          direct_(columns == panel_width<T>()) {
        if (epilogue.bias == nullptr) {
            bias_ = no_bias<T>.data();
        } else if (direct_) {
            bias_ = epilogue.bias;
        } else {
            padded_bias_.fill(T(0));
            std::copy_n(epilogue.bias, columns, padded_bias_.data());
            bias_ = padded_bias_.data();
        }
    }

    void multiply(const LeftPiece<T>& left, std::int64_t rows) {
        for (std::int64_t row = 0; row < rows;) {
            const int height = rows_of_next_block(rows - row);
            if (2 * columns_ <= panel_width<T>()) {
                multiply_rows_of<1>(left, row, height);
            } else {
                multiply_rows_of<2>(left, row, height);
            }
            row += height;
        }
    }

private:
    [[nodiscard]] bool activates() const {
        return finishes_ && (activation_ != Activation::none || slope_ != nullptr);
    }

    template <int vectors>
    HWY_INLINE void multiply_rows_of(const LeftPiece<T>& left, std::int64_t row, int height) {
        T* const c = c_ + row * stride_;
        Block<T> block{bias_,
                       0,
                       sums_.data(),
                       width,
                       left.row(row),
                       left.row_stride,
                       left.inner_stride,
                       panel_,
                       panel_stride_,
                       left.elements,
                       part_of_next_panel(row, left.elements)};
        if (direct_ && adds_) block.start = c, block.start_stride = stride_;
        if (direct_ && !activates()) block.sums = c, block.sums_stride = stride_;
        if (adds_ && !direct_) {
            read_present_values(c, height);
            block.start = sums_.data();
            block.start_stride = width;
        }
        multiply_block<vectors>(height, block);
        if (block.sums == sums_.data()) finish<vectors>(c, row, height);
    }

    /// The part that the block at this row prefetches; all blocks together fetch the whole panel.
    [[nodiscard]] const char* part_of_next_panel(std::int64_t row, std::int64_t elements) const {
        const std::int64_t size = elements * panel_stride_ * static_cast<std::int64_t>(sizeof(T));
        const std::int64_t share = elements / rows_of_prefetch * bytes_of_prefetch;
        const std::int64_t begin = row / block_rows * share;
        return reinterpret_cast<const char*>(next_panel_) + (begin + share <= size ? begin : 0);
    }

    void read_present_values(const T* c, int height) {
        for (int i = 0; i < height; ++i) {
            T* const row = sums_.data() + i * width;
            std::copy_n(c + i * stride_, columns_, row);
            std::fill(row + columns_, row + width, T(0));
        }
    }

    template <int vectors>
    HWY_INLINE void finish(T* c, std::int64_t row, int height) {
        T* const slope = slope_ == nullptr || !finishes_ ? nullptr : slope_ + row * stride_;
        const Activation activation = finishes_ ? activation_ : Activation::none;
        finish_block<block_rows, width>(
            Activated<T>{sums_.data(), width, c, slope, stride_, height, columns_},
            vectors * panel_width<T>() / 2, activation);
    }

    static constexpr std::int64_t width = most_columns<T>;

    T* c_;
    std::int64_t stride_;
    const T* panel_;
    const T* next_panel_;  ///< this one if it is the last
    std::int64_t panel_stride_;
    std::int64_t columns_;
    T* slope_;
    Activation activation_;
    bool adds_;      ///< adds the product to the values in c
    bool finishes_;  ///< the sum is complete afterwards
    bool direct_;    ///< the panel's blocks can use c directly
    const T* bias_;
    std::array<T, static_cast<std::size_t>(width)> padded_bias_;
    alignas(HWY_MAX_BYTES) std::array<T, static_cast<std::size_t>(block_rows* width)> sums_{};
};

template <class T>
void multiply(T* c, std::int64_t stride, const LeftMatrix<T>& left, std::int64_t m,
              const PackedMatrix<T>& right, const Epilogue<T>& epilogue) {
    const std::int64_t k = right.inner_length();
    const std::int64_t most_rows = row_block<T>(k, right.columns());
    // Copying pays if several panels read the copy.
    const bool copies =
        left.inner_stride != 1 && (left.row_stride != 1 || right.columns() > most_unpacked);
    T* copy = nullptr;
    if (copies) {
        const std::int64_t rows = chunk_count(std::min(m, most_rows), block_rows) * block_rows;
        copy = scratch_of_thread<T>(static_cast<std::size_t>(rows * std::min(inner_block, k)));
    }
    for (std::int64_t row = 0; row < m; row += most_rows) {
        const std::int64_t rows = std::min(most_rows, m - row);
        // At least once, so that an empty sum gets its epilogue.
        std::int64_t inner = 0;
        do {
            const std::int64_t elements = std::min(inner_block, k - inner);
            const LeftMatrix<T> part{left.data + row * left.row_stride + inner * left.inner_stride,
                                     left.row_stride, left.inner_stride};
            const LeftPiece<T> piece =
                copies ? copy_left(copy, part, rows, elements)
                       : LeftPiece<T>{part.data, part.row_stride, part.inner_stride,
                                      block_rows * part.row_stride, elements};
            for (std::int64_t column = 0; column < right.columns(); column += right.panel_width()) {
                Epilogue<T> of_columns = epilogue;
                if (epilogue.bias != nullptr) of_columns.bias += column;
                if (epilogue.slope != nullptr) of_columns.slope += row * stride + column;
                const std::int64_t index = column / right.panel_width(),
                                   first = inner * right.inner_stride();
                const bool last = column + right.panel_width() >= right.columns();
                PanelProduct<T>(c + row * stride + column, stride, right.panel(index) + first,
                                right.panel(last ? index : index + 1) + first, right.inner_stride(),
                                std::min(right.panel_width(), right.columns() - column), of_columns,
                                inner == 0, inner + elements == k)
                    .multiply(piece, rows);
            }
            inner += elements;
        } while (inner < k);
    }
}

void multiply_float(float* c, std::int64_t stride, const LeftMatrix<float>& left, std::int64_t m,
                    const PackedMatrix<float>& right, const Epilogue<float>& epilogue) {
    if constexpr (HWY_MAX_BYTES == 64) {
        const int parts = tile_parts(right.inner_length(), right.panel_width(), right.precision());
        if (parts > 0) {
            multiply_in_tiles(parts, c, stride, left, m, right, epilogue);
            return;
        }
    }
    multiply(c, stride, left, m, right, epilogue);
}

void multiply_double(double* c, std::int64_t stride, const LeftMatrix<double>& left, std::int64_t m,
                     const PackedMatrix<double>& right, const Epilogue<double>& epilogue) {
    multiply(c, stride, left, m, right, epilogue);
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
                // The columns are pages apart, so the processor does not foresee this by itself.
                if (last < k) __builtin_prefetch(from + last * inner_stride + j * column_stride);
                for (std::int64_t i = first; i < last; ++i)
                    to[i * width + j] = from[i * inner_stride + j * column_stride];
            }
        }
        for (std::int64_t i = first; i < last; ++i)
            std::fill(to + i * width + columns, to + (i + 1) * width, T(0));
    }
}

template <class T>
std::int64_t panel_width_of() {
    return HWY_DYNAMIC_DISPATCH(panel_bytes)() / static_cast<std::int64_t>(sizeof(T));
}

}  // namespace

template <class T>
PackedMatrix<T>::PackedMatrix(const T* b, std::int64_t k, std::int64_t n, std::int64_t inner_stride,
                              std::int64_t column_stride, MatmulPrecision precision)
    : k_(k),
      n_(n),
      panel_width_(panel_width_of<T>()),
      inner_stride_(panel_width_),
      precision_(precision) {
    panel_size_ = k * panel_width_;
    if constexpr (std::is_same_v<T, float>) {
        parts_ = tile_parts(k, panel_width_, precision);
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
        if (column_stride == 1) {
            pack_rows(Panels<T>{panels + begin * panel_size_, k, panel_width_, panel_size_},
                      b + begin * panel_width_,
                      std::min(n, end * panel_width_) - begin * panel_width_, inner_stride);
            return;
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
    view.panel_width_ = view.panel_size_ = panel_width_of<T>();
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
    return panel_width_of<T>();
}

template class PackedMatrix<float>;
template class PackedMatrix<double>;

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
    if (emulates_medium() && lowers_precision(right.inner_length(), right.precision()))
        return multiply_rounded(c, row_stride, left, m, right, epilogue);
    HWY_DYNAMIC_DISPATCH(multiply_float)(c, row_stride, left, m, right, epilogue);
}

template <>
void multiply_packed(double* c, std::int64_t row_stride, const LeftMatrix<double>& left,
                     std::int64_t m, const PackedMatrix<double>& right,
                     const Epilogue<double>& epilogue) {
    HWY_DYNAMIC_DISPATCH(multiply_double)(c, row_stride, left, m, right, epilogue);
}

}  // namespace stymo::kernels
#endif
