#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "nn/engine/image_rows.h"
#include "nn/engine/packed_layer.h"
#include "nn/layers/mask_branch.h"
#include "nn/layers/render_block.h"

namespace stymo {

/// A pool of buffers. `take` and `give_back` are thread-safe. The buffer that was given back last
/// is handed out first.
template <class Buffers>
class BufferPool {
public:
    /// Adds buffers until the pool holds `count`, and calls prepare(buffers) for all of them. No
    /// buffer may be in use during the call.
    template <class Prepare>
    void fill(std::int64_t count, Prepare prepare) {
        while (std::ssize(free_) < count) free_.push_back(std::make_unique<Buffers>());
        for (const std::unique_ptr<Buffers>& buffers : free_) prepare(*buffers);
    }
    /// The caller must not take more buffers at once than the pool holds.
    [[nodiscard]] std::unique_ptr<Buffers> take() {
        const std::scoped_lock lock(mutex_);
        std::unique_ptr<Buffers> buffers = std::move(free_.back());
        free_.pop_back();
        return buffers;
    }
    void give_back(std::unique_ptr<Buffers> buffers) {
        const std::scoped_lock lock(mutex_);
        free_.push_back(std::move(buffers));
    }

private:
    std::mutex mutex_;
    std::vector<std::unique_ptr<Buffers>> free_;
};

/// The weights of a folded render block and of its lateral layer of the mask branch, in the memory
/// layout of the renderer.
struct PackedBlock {
    /// Output k * channels + c is channel c of sub-pixel k = 2 row + column.
    PackedLayer<float> detail;
    PackedLayer<float> modulated0;
    PackedLayer<float> modulated1;
    std::vector<float> rgb_weight;  ///< (3, out)
    std::vector<float> rgb_bias;
    PackedLayer<float> lateral;  ///< empty without a mask

    MatmulPrecision precision;  ///< of all layers but those of RGB

    PackedBlock(const FoldedRenderBlock& block, const FoldedLayer* mask_lateral,
                MatmulPrecision precision_of_layers);
    /// Replaces the modulated layers by those of `block`.
    void set_style(const FoldedRenderBlock& block);

    [[nodiscard]] std::int64_t in() const { return modulated0.inputs(); }
    [[nodiscard]] std::int64_t out() const { return modulated1.outputs(); }
};

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
