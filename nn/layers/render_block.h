#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "nn/layer_memory.h"
#include "nn/layers/linear.h"
#include "nn/layers/modulated_linear.h"

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
