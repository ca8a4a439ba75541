#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>

#include "core/matmul_precision.h"
#include "nn/layers/mask_branch.h"
#include "nn/layers/render_block.h"

namespace stymo {

/// Pixels of all render blocks, each block at its own resolution, and the number of these pixels
/// whose features the last frame computed.
struct BlockCounts {
    std::int64_t pixels = 0;
    std::int64_t pixels_computed = 0;
};

/// Runs the render blocks and the mask branch of one face: from a feature map to an image. The
/// reference implementation is Decoder::decode_feature_map.
///
/// All empty rays have the same features. A pixel whose receptive field holds only empty rays
/// therefore has a value that is computed once for each block. All other pixels are computed in
/// strips of rows, whose buffers stay in the second-level cache. The first block's upsampled
/// features do not depend on the style and are kept. A new style therefore costs less than a new
/// feature map.
class BlockRenderer {
public:
    /// Uses the first of `blocks`, as many as are needed to double `rays_per_side` up to
    /// `resolution`. Without `mask` the renderer gives no mask. Throws ValueError if `resolution`
    /// is not `rays_per_side` doubled at least once and at most as often as there are blocks.
    BlockRenderer(std::span<const FoldedRenderBlock> blocks,
                  const std::optional<FoldedMaskBranch>& mask, std::int64_t rays_per_side,
                  std::int64_t resolution, MatmulPrecision precision = matmul_precision());
    ~BlockRenderer();
    BlockRenderer(BlockRenderer&&) noexcept;

    /// Replaces the modulated layers by those of the same blocks for another style. Throws
    /// ShapeError for fewer blocks than the renderer uses.
    void set_style(std::span<const FoldedRenderBlock> blocks);
    /// `feature_map` (rays_per_side, rays_per_side, channels). `occupied` (rays_per_side,
    /// rays_per_side) is 0 for each empty ray. All empty rays must have the same features. Throws
    /// ShapeError for other sizes.
    void set_feature_map(std::span<const float> feature_map,
                         std::span<const std::uint8_t> occupied);
    /// Writes the image (resolution, resolution, 3) and, unless `mask` is empty, the mask
    /// (resolution, resolution), both in [0, 1]. Allocates nothing after the first call. Throws
    /// ValueError if no feature map was set, or if a mask is asked for and there is no mask branch;
    /// ShapeError for other sizes. When a stop is requested, it returns early and the image and the
    /// mask are incomplete.
    void render(std::span<float> image, std::span<float> mask = {},
                const std::stop_token& stop = {});
    /// Counts of the current feature map.
    [[nodiscard]] const BlockCounts& counts() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace stymo
