#pragma once

#include <cstdint>
#include <string>

#include "nn/layers/linear.h"

namespace stymo {

/// Learnt upsampling of an image: a 1x1 layer C -> 4C with leaky ReLU (slope 0.2, no gain) and a
/// pixel shuffle compute the detail. It is added to the nearest-neighbour upsampling, and the sum
/// is blurred by [1,2,1] / 4 along both axes with mirrored border. This is HeadNeRF's upsampler
/// with one layer instead of two, and with interleaved channels of the detail, so that with zero
/// weights it is an exact (blurred) nearest-neighbour upsampling.
class Upsampler {
public:
    /// Creates `prefix`.detail.{weight,bias}.
    Upsampler(ParameterStore& store, const std::string& prefix, std::int64_t channels, Rng& rng);

    /// (B, H, W, C) -> (B, 2H, 2W, C)
    [[nodiscard]] Variable operator()(const Variable& x) const;
    /// The layer C -> 4C; output channel 4 c + 2 i + j is the detail of channel c at row i, column
    /// j of the upsampled pixel.
    [[nodiscard]] FoldedLayer folded_detail() const { return detail_.folded(); }
    /// Number of elements saved for the backward pass, for one pixel of the input: the detail. The
    /// input is saved by the layer that made it.
    [[nodiscard]] std::int64_t saved() const { return detail_.outputs(); }
    /// Multiply-adds for one pixel of the input.
    [[nodiscard]] std::int64_t multiply_adds() const { return detail_.multiply_adds(); }

private:
    Linear detail_;
};

/// Fixed upsampling for the sum of RGB images: bilinear, then the same blur. (B, H, W, C) -> (B,
/// 2H, 2W, C).
[[nodiscard]] Variable upsample_smoothly(const Variable& image);

}  // namespace stymo
