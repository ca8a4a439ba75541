#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "nn/layers/render_block.h"

namespace stymo {

/// HeadNeRF's render block, which no code modulates. Two 1x1 layers C -> 2C -> 4C, each with leaky
/// ReLU (slope 0.2, no gain), compute the detail that is added to the nearest-neighbour upsampling
/// before the blur. A layer with leaky ReLU follows to the block's channels, and a layer to RGB,
/// whose result is added to the upsampled RGB of the blocks before. The first block also computes
/// an RGB image of its input features. Unlike in HeadNeRF, the channels of the detail are
/// interleaved, as in `Upsampler`.
class PlainRenderBlock : public UpsampleBlock {
public:
    /// Creates `prefix`.{widened,detail,narrowed,to_rgb}.{weight,bias}, and for the first block
    /// `prefix`.to_rgb_below.
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
