#pragma once

#include <cstdint>
#include <string>

#include "nn/layers/linear.h"

namespace stymo {

/// Learnt upsampling of an image: a 1x1 layer C -> 4C with leaky ReLU (slope 0.2, no gain) gives
/// the detail that is added to the nearest neighbour; pixel shuffle; [1,2,1] blur with mirrored
/// border. HeadNeRF's upsampler with one layer instead of two, and with the channels of the
/// residual interleaved, so that near zero weights it is an exact (blurred) nearest-neighbour
/// upsampling.
class Upsampler {
public:
    /// Creates `prefix`.detail.{weight,bias}.
    Upsampler(ParameterStore& store, const std::string& prefix, std::int64_t channels, Rng& rng);

    /// (B, H, W, C) -> (B, 2H, 2W, C)
    [[nodiscard]] Variable operator()(const Variable& x) const;
    /// The layer C -> 4C; output channel 4 c + 2 i + j is the detail of channel c at row i, column
    /// j of the upsampled pixel.
    [[nodiscard]] FoldedLayer folded_detail() const { return detail_.folded(); }
    /// Numbers saved for the backward pass: the details, for one pixel of the input. The input
    /// itself is saved by the layers that made it.
    [[nodiscard]] std::int64_t saved() const { return detail_.outputs(); }
    /// Multiply-adds for one pixel of the input.
    [[nodiscard]] std::int64_t multiply_adds() const { return detail_.multiply_adds(); }

private:
    Linear detail_;
};

/// Fixed upsampling of an image, for the sum of RGB images: bilinear, then the same blur. (B, H, W,
/// C) -> (B, 2H, 2W, C).
[[nodiscard]] Variable upsample_smoothly(const Variable& image);

}  // namespace stymo
