#pragma once

#include <memory>
#include <string>
#include <vector>

#include "nn/models/decoder.h"

namespace stymo {

/// The part of the decoder that turns composited rays into images (DecoderConfig::render).
class ImageStage {
public:
    ImageStage() = default;
    ImageStage(const ImageStage&) = delete;
    ImageStage& operator=(const ImageStage&) = delete;
    virtual ~ImageStage() = default;

    /// Rays along one side for images of up to this resolution (0: the model's resolution).
    [[nodiscard]] virtual std::int64_t rays_per_side(std::int64_t resolution) const = 0;
    /// Channels of the feature map.
    [[nodiscard]] virtual std::int64_t channels() const = 0;
    /// Converts composited values of the rays to values of the feature map.
    [[nodiscard]] virtual Variable feature_values(const Variable& composited) const = 0;
    /// feature_map (B, rays, rays, channels), style (B, texture and light) -> a Decoded with
    /// images, feature_map and, unless the mask comes from the rays, mask_logit.
    [[nodiscard]] virtual Decoded images(const Variable& feature_map, const Variable& style,
                                         const DecodeOptions& options) const = 0;
    /// Decoded::mask_logit from the transmittance (B, side * side, 1) if the mask comes from the
    /// rays, else undefined.
    [[nodiscard]] virtual Variable mask_of_rays(const Variable& transmittance,
                                                std::int64_t side) const = 0;
    /// Multiply-adds of the matrix products for one image.
    [[nodiscard]] virtual std::int64_t multiply_adds(std::int64_t resolution) const = 0;
    [[nodiscard]] virtual LayerMemory memory(const DecodeOptions& options,
                                             std::int64_t images) const = 0;
    /// Render blocks and mask branch with the style folded in. Both throw ValueError for a stage
    /// without render blocks.
    [[nodiscard]] virtual std::vector<FoldedRenderBlock> folded_blocks(
        const Variable& style, std::int64_t resolution) const = 0;
    [[nodiscard]] virtual FoldedMaskBranch folded_mask() const = 0;
};

/// Makes the stage that the configuration selects. Creates its parameters under `prefix`.
[[nodiscard]] std::unique_ptr<ImageStage> make_image_stage(const DecoderConfig& config,
                                                           const ResolutionLadder& ladder,
                                                           ParameterStore& store,
                                                           const std::string& prefix,
                                                           std::int64_t style_size, Rng& rng);

}  // namespace stymo
