#pragma once

#include <cstdint>
#include <string>

#include "nn/layers/modulated_linear.h"
#include "nn/layers/upsampler.h"

namespace stymo {

/// What one doubling of the resolution hands to the next.
struct Rendered {
    Variable features;  ///< (B, S, S, channels)
    Variable rgb;       ///< (B, S, S, 3) before the tanh, the sum over all blocks so far
};

/// A render block for the style of one face.
struct FoldedRenderBlock {
    FoldedLayer detail;  ///< of the upsampler
    FoldedLayer modulated0;
    FoldedLayer modulated1;
    FoldedLayer to_rgb;
};

/// One render block of the paper: learnt doubling, two modulated layers with leaky ReLU, and a plain 1x1 layer to RGB, whose
/// result is added to the doubled RGB of the blocks before.
class RenderBlock {
public:
    /// Creates `prefix`.{upsampler,modulated0,modulated1,to_rgb}.
    RenderBlock(ParameterStore& store, const std::string& prefix, std::int64_t in, std::int64_t out, std::int64_t style_size,
                Rng& rng);

    /// `below`: features (B, S, S, in) and rgb (B, S, S, 3), or no rgb at the first block; style (B, style_size). Doubles S.
    /// `recomputed`: keeps the resulting features but nothing on the way to them, which the backward pass computes once more.
    [[nodiscard]] Rendered operator()(const Rendered& below, const Variable& style, bool recomputed = false) const;
    /// For the style of one face, (1, style_size).
    [[nodiscard]] FoldedRenderBlock folded(const Variable& style) const;

private:
    [[nodiscard]] Variable features(const Variable& below, const Variable& style) const;
    /// Image by image, so that the backward pass never holds what lies in between for more than one.
    [[nodiscard]] Variable recomputed_features(const Variable& below, const Variable& style) const;

    Upsampler upsampler_;
    ModulatedLinear modulated0_;
    ModulatedLinear modulated1_;
    Linear to_rgb_;
};

}  // namespace stymo
