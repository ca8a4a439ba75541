#pragma once

#include <cstdint>
#include <string>

#include "nn/layer_memory.h"
#include "nn/layers/modulated_linear.h"
#include "nn/layers/upsampler.h"

namespace stymo {

/// The output of one render block and the input of the next.
struct Rendered {
    Variable features;  ///< (B, S, S, channels)
    Variable rgb;       ///< (B, S, S, 3) before the tanh, the sum over all blocks so far
};

/// A render block with the style of one face folded in.
struct FoldedRenderBlock {
    FoldedLayer detail;  ///< Upsampler::folded_detail
    FoldedLayer modulated0;
    FoldedLayer modulated1;
    FoldedLayer to_rgb;
};

/// Sizes from which the memory of an upsampling is computed.
struct UpsampleWidths {
    std::int64_t in = 0;       ///< channels of the features below
    std::int64_t out = 0;      ///< channels of the features above
    std::int64_t between = 0;  ///< numbers saved between the two, for one pixel of the input
};

/// Interface of a block that doubles the resolution.
class UpsampleBlock {
public:
    virtual ~UpsampleBlock() = default;

    /// `below`: features (B, S, S, in) and rgb (B, S, S, 3), or no rgb at the first block; style
    /// (B, style_size). Doubles S. `recomputed`: keeps only the resulting features; the backward
    /// pass computes the intermediate values again.
    [[nodiscard]] virtual Rendered operator()(const Rendered& below, const Variable& style,
                                              bool recomputed) const = 0;
    /// The block folded for the style of one face, (1, style_size), for the fast renderer. Throws
    /// ValueError for a block without modulation.
    [[nodiscard]] virtual FoldedRenderBlock folded(const Variable& style) const = 0;
    /// Multiply-adds of the matrix products for one pixel of the input.
    [[nodiscard]] virtual std::int64_t multiply_adds() const = 0;
    [[nodiscard]] virtual UpsampleWidths widths() const = 0;
    /// Memory for images of this side after upsampling.
    [[nodiscard]] LayerMemory memory(std::int64_t side, std::int64_t images, bool recomputed) const;
};

/// One render block of the paper: learnt upsampling, two modulated layers with leaky ReLU, and a
/// linear 1x1 layer to RGB, whose result is added to the upsampled RGB of the blocks before.
class RenderBlock : public UpsampleBlock {
public:
    /// Creates `prefix`.{upsampler,modulated0,modulated1,to_rgb}.
    RenderBlock(ParameterStore& store, const std::string& prefix, std::int64_t in, std::int64_t out,
                std::int64_t style_size, Rng& rng);

    [[nodiscard]] Rendered operator()(const Rendered& below, const Variable& style,
                                      bool recomputed = false) const override;
    [[nodiscard]] FoldedRenderBlock folded(const Variable& style) const override;
    [[nodiscard]] std::int64_t multiply_adds() const override;
    [[nodiscard]] UpsampleWidths widths() const override;

private:
    [[nodiscard]] Variable features(const Variable& below, const Variable& style) const;
    /// Recomputes image by image, so that the backward pass holds the intermediate values of one
    /// image only.
    [[nodiscard]] Variable recomputed_features(const Variable& below, const Variable& style) const;

    Upsampler upsampler_;
    ModulatedLinear modulated0_;
    ModulatedLinear modulated1_;
    Linear to_rgb_;
};

}  // namespace stymo
