#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "nn/engine/aligned_vector.h"
#include "nn/engine/packed_block.h"
#include "nn/engine/pixel_rows.h"
#include "nn/kernels/image_rows.h"

namespace stymo {

inline constexpr std::int64_t colors = 3;

/// What all pixels have that only empty rays reach.
template <class T>
struct Background {
    AlignedVector<T> features;
    std::vector<float> rgb;   ///< of the last block alone, without bias
    std::vector<float> mask;  ///< the same of its lateral
};

/// An image between two blocks, or before the first (without RGB and mask), or after the last
/// (without features). RGB and mask are sums over the blocks so far, as differences from the
/// background's.
template <class T>
struct BlockImage {
    std::int64_t side = 0;
    PixelRows occupied;         ///< what empty rays alone do not decide
    PixelRows read;             ///< what the next block reads
    PixelRows shown;            ///< where RGB and mask may differ from the background's
    AlignedVector<T> features;  ///< of `read`
    AlignedVector<float> rgb;   ///< (side, side, 3)
    AlignedVector<float> mask;  ///< (side, side, mask channels)
    Background<T> background;
};

/// Where the last block draws.
struct Canvas {
    std::span<float> image;
    std::span<float> mask;  ///< empty: none
    std::vector<float> logit_weight;
    float background_logit = 0.0F;
    float background_mask = 0.0F;          ///< the same in [0, 1]
    std::vector<float> background_rgb;     ///< a row of the image before the tanh
    std::vector<float> background_colors;  ///< the same in [0, 1]
};

/// What one thread needs for a strip.
template <class T>
struct StripBuffers {
    std::array<AlignedVector<T>, 2> detail;
    std::vector<const T*> detail_rows;
    AlignedVector<T> blurred;
    AlignedVector<T> hidden;
    AlignedVector<T> features;
    AlignedVector<float> lateral;
    AlignedVector<float> scratch;
    AlignedVector<float> rgb_row;
    AlignedVector<float> mask_row;
};

/// One block at work: from the image below it to the one above. Everything is computed by strips of
/// rows, in batches whose buffers stay in the second-level cache.
template <class T>
struct BlockStep {
    const PackedBlock<T>& block;
    const BlockImage<T>& below;
    BlockImage<T>& above;
    const Canvas& canvas;
    bool first;
    bool last;

    /// Makes buffers large enough for this block.
    void prepare(StripBuffers<T>& buffers) const;
    /// What comes of rows [begin, end) of the image below.
    void run(std::int64_t begin, std::int64_t end, StripBuffers<T>& buffers) const;
    /// The same given what is blurred already, (pixels that `above` has occupied, in).
    void run_blurred(std::int64_t begin, std::int64_t end, std::span<const T> blurred,
                     StripBuffers<T>& buffers) const;
    /// Both rows that come of row `row` below, one behind the other, through the learnt upsampling.
    /// `detail_rows`: where the detail of the pixels begins that this row and the ones beside it
    /// read.
    void blur_rows(std::int64_t row, std::span<const T* const> detail_rows, T* out) const;
    /// The image of one pixel, which the background is.
    void run_background(StripBuffers<T>& buffers) const;

private:
    [[nodiscard]] std::int64_t detail_pixels() const;
    [[nodiscard]] std::int64_t batch_pixels() const { return 4 * detail_pixels(); }
    void finish_rows(std::int64_t begin, std::int64_t end, const T* blurred,
                     StripBuffers<T>& buffers) const;
    [[nodiscard]] T* surround_with_background(std::int64_t y) const;
    void double_sum(float* to, const AlignedVector<float>& sum, std::int64_t row,
                    std::int64_t channels, const kernels::UpsampleFilter& filter,
                    StripBuffers<T>& buffers) const;
    void finish_rgb_row(std::int64_t row, const T* features, StripBuffers<T>& buffers) const;
    void finish_mask_row(std::int64_t row, StripBuffers<T>& buffers) const;
};

extern template struct BlockStep<float>;
extern template struct BlockStep<kernels::BFloat16>;
extern template struct BlockStep<kernels::Float16>;

}  // namespace stymo
