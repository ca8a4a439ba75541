// Included once for each instruction set, hence the toggle in place of `#pragma once`.
#if defined(STYMO_CORE_KERNELS_GEMM_TILES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STYMO_CORE_KERNELS_GEMM_TILES_INL_H
#undef STYMO_CORE_KERNELS_GEMM_TILES_INL_H
#else
#define STYMO_CORE_KERNELS_GEMM_TILES_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>

#include "core/kernels/epilogue-inl.h"
#include "core/kernels/gemm.h"
#include "core/kernels/tile_product.h"
#include "core/parallel.h"

/// Products of float32 in blocks of tiles.
HWY_BEFORE_NAMESPACE();
namespace stymo::kernels::HWY_NAMESPACE {

/// Inner elements that are summed without leaving the tiles.
constexpr std::int64_t tile_inner = 1024;
/// Bytes of panels that are multiplied with all blocks of rows before the next panels; they stay in
/// the second-level cache.
constexpr std::int64_t panels_in_cache = 1 << 20;

/// One block of rows times one panel, for one piece of the inner dimension.
struct TileSums {
    int parts;
    float* c;
    std::int64_t stride;
    const BFloat16* left;
    const BFloat16* right;
    std::int64_t elements;  ///< of the inner dimension
    std::int64_t rows;
    std::int64_t columns;
    const float* bias;  ///< of `tile_block` columns; null: none
    float* slope;       ///< null: none
    Activation activation;
    bool adds;  ///< adds the product to the values in c

    HWY_INLINE void multiply() const {
        alignas(64) std::array<float, static_cast<std::size_t>(tile_block * tile_block)> sums;
        const int row_tiles = rows > tile_block / 2 ? 2 : 1,
                  column_tiles = columns > tile_block / 2 ? 2 : 1;
        const bool fits = columns == tile_block && rows == row_tiles * tile_block / 2,
                   activates = activation != Activation::none || slope != nullptr;
        TileBlock block{parts,       left,      right, chunk_count(elements, tile_step),
                        rows,        elements,  bias,  0,
                        sums.data(), tile_block};
        if (fits && !activates) block.sums = c, block.sums_stride = stride;
        if (adds && fits) {
            block.start = c;
            block.start_stride = stride;
        } else if (adds) {
            for (std::int64_t i = 0; i < rows; ++i)
                std::copy_n(c + i * stride, columns, sums.data() + i * tile_block);
            block.start = sums.data();
            block.start_stride = tile_block;
        }
        multiply_tiles(row_tiles, column_tiles, block);
        if (block.sums != sums.data()) return;
        finish_block<tile_block, tile_block>(
            Activated<float>{sums.data(), tile_block, c, slope, stride, rows, columns},
            column_tiles * tile_block / 2, activation);
    }
};

/// A product of split rows and split panels, in pieces of the inner dimension.
class TileProduct {
public:
    TileProduct(int parts, float* c, std::int64_t stride, const LeftMatrix<float>& left,
                std::int64_t m, const PackedMatrix<float>& right, const Epilogue<float>& epilogue)
        : parts_(parts),
          c_(c),
          stride_(stride),
          left_(left),
          m_(m),
          right_(right),
          epilogue_(epilogue) {}

    void multiply() {
        const TileLoan loan;
        const std::int64_t k = right_.inner_length();
        for (inner_ = 0; inner_ < k; inner_ += tile_inner) {
            elements_ = std::min(tile_inner, k - inner_);
            steps_ = chunk_count(elements_, tile_step);
            const std::int64_t panels = chunk_count(right_.columns(), tile_block),
                               at_once = std::max<std::int64_t>(1, panels_in_cache / split_bytes());
            for (std::int64_t panel = 0; panel < panels; panel += at_once)
                multiply_panels(panel, std::min(panel + at_once, panels));
        }
    }

private:
    [[nodiscard]] std::int64_t split_size() const { return steps_ * parts_ * tile_step_size; }
    [[nodiscard]] std::int64_t split_bytes() const {
        return split_size() * static_cast<std::int64_t>(sizeof(BFloat16));
    }

    /// The current piece of a split panel.
    const BFloat16* split(std::int64_t panel) const {
        return right_.split_panel(panel) + inner_ / tile_step * parts_ * tile_step_size;
    }

    void multiply_panels(std::int64_t first, std::int64_t last) {
        const std::int64_t copied = right_.parts() > 0 ? 0 : last - first;
        BFloat16* const rows =
            scratch_of_thread<BFloat16>(static_cast<std::size_t>((1 + copied) * split_size()));
        BFloat16* const panels = rows + split_size();
        for (std::int64_t i = 0; i < copied; ++i)
            split_right(parts_, panels + i * split_size(),
                        right_.panel(first + i) + inner_ * right_.inner_stride(), elements_,
                        tile_block, right_.inner_stride(), 1);
        for (std::int64_t row = 0; row < m_; row += tile_block) {
            const std::int64_t count = std::min(tile_block, m_ - row);
            split_left(parts_, rows,
                       {left_.data + row * left_.row_stride + inner_ * left_.inner_stride,
                        left_.row_stride, left_.inner_stride},
                       count, elements_);
            for (std::int64_t panel = first; panel < last; ++panel)
                sums_of(row, count, panel, rows,
                        copied > 0 ? panels + (panel - first) * split_size() : split(panel))
                    .multiply();
        }
    }

    // Inline, so that its fields stay in registers.
    HWY_INLINE TileSums sums_of(std::int64_t row, std::int64_t rows, std::int64_t panel,
                                const BFloat16* left, const BFloat16* right) {
        const bool last = inner_ + elements_ == right_.inner_length();
        const std::int64_t column = panel * tile_block,
                           columns = std::min(tile_block, right_.columns() - column);
        TileSums result{parts_,
                        c_ + row * stride_ + column,
                        stride_,
                        left,
                        right,
                        elements_,
                        rows,
                        columns,
                        nullptr,
                        nullptr,
                        last ? epilogue_.activation : Activation::none,
                        epilogue_.present_values || inner_ > 0};
        if (epilogue_.bias != nullptr) {
            result.bias = epilogue_.bias + column;
            if (columns < tile_block) {
                std::copy_n(result.bias, columns, padded_bias_.data());
                result.bias = padded_bias_.data();
            }
        }
        if (epilogue_.slope != nullptr && last)
            result.slope = epilogue_.slope + row * stride_ + column;
        return result;
    }

    int parts_;
    float* c_;
    std::int64_t stride_;
    const LeftMatrix<float>& left_;
    std::int64_t m_;
    const PackedMatrix<float>& right_;
    const Epilogue<float>& epilogue_;
    std::int64_t inner_ = 0;     ///< first inner index of the current piece
    std::int64_t elements_ = 0;  ///< length of the current piece
    std::int64_t steps_ = 0;
    std::array<float, static_cast<std::size_t>(tile_block)> padded_bias_{};
};

inline void multiply_in_tiles(int parts, float* c, std::int64_t stride,
                              const LeftMatrix<float>& left, std::int64_t m,
                              const PackedMatrix<float>& right, const Epilogue<float>& epilogue) {
    TileProduct(parts, c, stride, left, m, right, epilogue).multiply();
}

}  // namespace stymo::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
