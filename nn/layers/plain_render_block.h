#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "nn/layers/render_block.h"

namespace stymo {

/// HeadNeRF's render block, which no code modulates: upsampling by two 1x1 layers C -> 2C -> 4C,
/// each with leaky ReLU (slope 0.2, no gain), added to the nearest neighbour before the blur; one
/// layer with leaky ReLU to the block's channels; a layer to RGB, added to the upsampled RGB of the
/// blocks before. The first block also computes an RGB image of its input features. Unlike
/// HeadNeRF's, the channels of the residual are interleaved, as in `Upsampler`.
class PlainRenderBlock : public UpsampleBlock {
public:
    /// Creates `prefix`.{widened,detail,narrowed,to_rgb}.{weight,bias}, for the first block
    /// `prefix`.to_rgb_below too.
    PlainRenderBlock(ParameterStore& store, const std::string& prefix, std::int64_t in,
                     std::int64_t out, bool first, Rng& rng);

    /// Ignores the style.
    [[nodiscard]] Rendered operator()(const Rendered& below, const Variable& style,
                                      bool recomputed = false) const override;
    [[nodiscard]] FoldedRenderBlock folded(const Variable& style) const override;
    [[nodiscard]] std::int64_t multiply_adds() const override;
    [[nodiscard]] UpsampleWidths widths() const override;

private:
    [[nodiscard]] Variable features(const Variable& below) const;

    Linear widened_;
    Linear detail_;
    Linear narrowed_;
    Linear to_rgb_;
    std::optional<Linear> to_rgb_below_;
};

}  // namespace stymo
