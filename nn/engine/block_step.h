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
struct Background {
    AlignedVector<float> features;
    std::vector<float> rgb;   ///< contribution of this block alone, without bias
    std::vector<float> mask;  ///< contribution of this block's lateral layer
};

/// An image between two blocks. The image before the first block has no RGB and no mask; the one
/// after the last block has no features. RGB and mask are sums over the blocks so far, minus the
/// background's sums.
struct BlockImage {
    std::int64_t side = 0;
    PixelRows occupied;             ///< pixels whose receptive field holds a ray that is not empty
    PixelRows read;                 ///< pixels that the next block reads
    PixelRows shown;                ///< pixels whose RGB and mask may differ from the background
    AlignedVector<float> features;  ///< of the pixels in `read`
    AlignedVector<float> rgb;       ///< (side, side, 3)
    AlignedVector<float> mask;      ///< (side, side, mask channels)
    Background background;
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
struct StripBuffers {
    std::array<AlignedVector<float>, 2> detail;
    std::vector<const float*> detail_rows;
    AlignedVector<float> blurred;
    AlignedVector<float> hidden;
    AlignedVector<float> features;
    AlignedVector<float> lateral;
    AlignedVector<float> scratch;
    AlignedVector<float> rgb_row;
    AlignedVector<float> mask_row;
};

/// Runs one block: computes the image `above`, of twice the side, from the image `below`. Strips of
/// rows are computed in batches whose buffers stay in the second-level cache.
struct BlockStep {
    const PackedBlock& block;
    const BlockImage& below;
    BlockImage& above;
    const Canvas& canvas;
    bool first;
    bool last;

    /// Makes buffers large enough for this block.
    void prepare(StripBuffers& buffers) const;
    /// Computes the rows of `above` that belong to rows [begin, end) of `below`.
    void run(std::int64_t begin, std::int64_t end, StripBuffers& buffers) const;
    /// The same if the learnt upsampling of the whole image is known: `blurred` (occupied pixels of
    /// `above`, in).
    void run_blurred(std::int64_t begin, std::int64_t end, std::span<const float> blurred,
                     StripBuffers& buffers) const;
    /// Applies the learnt upsampling: writes the two rows of `above` that belong to row `row` of
    /// `below` to `out`, one behind the other. `detail_rows[y]` points to the output of the detail
    /// layer for row y of `below`; it must be set for rows row - 1 to row + 1.
    void blur_rows(std::int64_t row, std::span<const float* const> detail_rows, float* out) const;
    /// Computes the background of `above` from the background of `below`.
    void run_background(StripBuffers& buffers) const;

private:
    [[nodiscard]] std::int64_t detail_pixels() const;
    [[nodiscard]] std::int64_t batch_pixels() const { return 4 * detail_pixels(); }
    void finish_rows(std::int64_t begin, std::int64_t end, const float* blurred,
                     StripBuffers& buffers) const;
    [[nodiscard]] float* surround_with_background(std::int64_t y) const;
    void upsample_sum(float* to, const AlignedVector<float>& sum, std::int64_t row,
                      std::int64_t channels, const kernels::UpsampleFilter& filter,
                      StripBuffers& buffers) const;
    void finish_rgb_row(std::int64_t row, const float* features, StripBuffers& buffers) const;
    void finish_mask_row(std::int64_t row, StripBuffers& buffers) const;
};

}  // namespace stymo
