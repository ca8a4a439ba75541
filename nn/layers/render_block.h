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

/// One doubling of the resolution.
class DoublingBlock {
public:
    virtual ~DoublingBlock() = default;

    /// `below`: features (B, S, S, in) and rgb (B, S, S, 3), or no rgb at the first block; style (B, style_size). Doubles S.
    /// `recomputed`: keeps the resulting features but nothing on the way to them, which the backward pass computes once more.
    [[nodiscard]] virtual Rendered operator()(const Rendered& below, const Variable& style, bool recomputed) const = 0;
    /// For the fast renderer, for the style of one face, (1, style_size). Throws ValueError for a block without modulation.
    [[nodiscard]] virtual FoldedRenderBlock folded(const Variable& style) const = 0;
    /// Of the matrix products, for one pixel of the input.
    [[nodiscard]] virtual std::int64_t multiply_adds() const = 0;
};

/// One render block of the paper: learnt doubling, two modulated layers with leaky ReLU, and a plain 1x1 layer to RGB, whose
/// result is added to the doubled RGB of the blocks before.
class RenderBlock : public DoublingBlock {
public:
    /// Creates `prefix`.{upsampler,modulated0,modulated1,to_rgb}.
    RenderBlock(ParameterStore& store, const std::string& prefix, std::int64_t in, std::int64_t out, std::int64_t style_size,
                Rng& rng);

    [[nodiscard]] Rendered operator()(const Rendered& below, const Variable& style, bool recomputed = false) const override;
    [[nodiscard]] FoldedRenderBlock folded(const Variable& style) const override;
    [[nodiscard]] std::int64_t multiply_adds() const override;

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
