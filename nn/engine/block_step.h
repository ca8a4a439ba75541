#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "nn/engine/aligned_vector.h"
#include "nn/engine/image_rows.h"
#include "nn/engine/packed_block.h"
#include "nn/engine/pixel_rows.h"

namespace stymo {

inline constexpr std::int64_t colors = 3;

/// Values of the pixels whose receptive field holds only empty rays.
template <class T>
struct Background {
    AlignedVector<T> features;
    std::vector<float> rgb;   ///< contribution of this block alone, without bias
    std::vector<float> mask;  ///< contribution of this block's lateral layer
};

/// An image between two blocks. The image before the first block has no RGB and no mask; the one
/// after the last block has no features. RGB and mask are sums over the blocks so far, minus the
/// background's sums.
template <class T>
struct BlockImage {
    std::int64_t side = 0;
    PixelRows occupied;         ///< pixels whose receptive field holds a ray that is not empty
    PixelRows read;             ///< pixels that the next block reads
    PixelRows shown;            ///< pixels whose RGB and mask may differ from the background
    AlignedVector<T> features;  ///< of the pixels in `read`
    AlignedVector<float> rgb;   ///< (side, side, 3)
    AlignedVector<float> mask;  ///< (side, side, mask channels)
    Background<T> background;
};

/// The output of the last block, with the background's final values.
struct Canvas {
    std::span<float> image;
    std::span<float> mask;  ///< empty: no mask is wanted
    std::vector<float> logit_weight;
    float background_logit = 0.0F;
    float background_mask = 0.0F;          ///< sigmoid of background_logit
    std::vector<float> background_rgb;     ///< one row of the image before the tanh
    std::vector<float> background_colors;  ///< the same row as final colours in [0, 1]
};

/// Buffers that one thread needs for a strip.
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

/// Runs one block: computes the image `above`, of twice the side, from the image `below`. Strips of
/// rows are computed in batches whose buffers stay in the second-level cache.
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
    /// Computes the rows of `above` that belong to rows [begin, end) of `below`.
    void run(std::int64_t begin, std::int64_t end, StripBuffers<T>& buffers) const;
    /// The same if the learnt upsampling of the whole image is known: `blurred` (occupied pixels of
    /// `above`, in).
    void run_blurred(std::int64_t begin, std::int64_t end, std::span<const T> blurred,
                     StripBuffers<T>& buffers) const;
    /// Applies the learnt upsampling: writes the two rows of `above` that belong to row `row` of
    /// `below` to `out`, one behind the other. `detail_rows[y]` points to the output of the detail
    /// layer for row y of `below`; it must be set for rows row - 1 to row + 1.
    void blur_rows(std::int64_t row, std::span<const T* const> detail_rows, T* out) const;
    /// Computes the background of `above` from the background of `below`.
    void run_background(StripBuffers<T>& buffers) const;

private:
    [[nodiscard]] std::int64_t detail_pixels() const;
    [[nodiscard]] std::int64_t batch_pixels() const { return 4 * detail_pixels(); }
    void finish_rows(std::int64_t begin, std::int64_t end, const T* blurred,
                     StripBuffers<T>& buffers) const;
    [[nodiscard]] T* surround_with_background(std::int64_t y) const;
    void upsample_sum(float* to, const AlignedVector<float>& sum, std::int64_t row,
                      std::int64_t channels, const kernels::UpsampleFilter& filter,
                      StripBuffers<T>& buffers) const;
    void finish_rgb_row(std::int64_t row, const T* features, StripBuffers<T>& buffers) const;
    void finish_mask_row(std::int64_t row, StripBuffers<T>& buffers) const;
};

extern template struct BlockStep<float>;
extern template struct BlockStep<kernels::BFloat16>;
extern template struct BlockStep<kernels::Float16>;

}  // namespace stymo
