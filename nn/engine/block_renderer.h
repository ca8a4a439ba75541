#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>

#include "nn/engine/precision.h"
#include "nn/layers/mask_branch.h"
#include "nn/layers/render_block.h"

namespace stymo {

/// How many pixels the render blocks have, each at its own resolution, and for how many of them the
/// last frame computed features.
struct BlockCounts {
    std::int64_t pixels = 0;
    std::int64_t pixels_computed = 0;
};

/// The render blocks and the mask branch of one face, from a feature map to an image (reference:
/// Decoder::decode_feature_map).
///
/// Empty rays share one value, and with it every pixel whose receptive field they fill: it is
/// computed once for each block. The other pixels go through a block by strips of rows that stay in
/// the second-level cache. What the first block makes of a feature map before any style enters is
/// kept, so that another style costs less than another feature map.
class BlockRenderer {
public:
    /// As many of `blocks` as double `rays_per_side` to `resolution`; without `mask` there is none.
    /// Throws ValueError for a resolution that the blocks do not reach.
    BlockRenderer(std::span<const FoldedRenderBlock> blocks,
                  const std::optional<FoldedMaskBranch>& mask, std::int64_t rays_per_side,
                  std::int64_t resolution, Precision precision);
    ~BlockRenderer();
    BlockRenderer(BlockRenderer&&) noexcept;

    /// The same blocks for another style: takes over their modulated layers.
    void set_style(std::span<const FoldedRenderBlock> blocks);
    /// `feature_map` (rays_per_side, rays_per_side, channels); `occupied`: for each ray, 0 if it is
    /// empty. All empty rays have the same features. Throws ShapeError for other sizes.
    void set_feature_map(std::span<const float> feature_map,
                         std::span<const std::uint8_t> occupied);
    /// Image (resolution, resolution, 3) and, unless that span is empty, mask (resolution,
    /// resolution), both in [0, 1]. Allocates nothing after the first call. Throws ValueError
    /// before the first feature map and for a mask without a branch, ShapeError for other sizes.
    /// Returns early, with images of no use, when a stop is requested.
    void render(std::span<float> image, std::span<float> mask = {},
                const std::stop_token& stop = {});
    [[nodiscard]] const BlockCounts& counts() const;

private:
    struct State;
    template <class T>
    struct TypedState;
    std::unique_ptr<State> state_;
};

}  // namespace stymo
