#include "nn/models/image_stage.h"

#include <span>

#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/render_block.h"

namespace stymo {
namespace {

std::unique_ptr<UpsampleBlock> make_block(const DecoderConfig& config, ParameterStore& store,
                                          const std::string& name, std::size_t index,
                                          std::int64_t style_size, Rng& rng) {
    const bool first = index == 0;
    const std::int64_t in = first ? config.feature_channels : config.block_channels[index - 1];
    const std::int64_t out = config.block_channels[index];
    if (config.conditioning == "concatenation")
        return std::make_unique<PlainRenderBlock>(store, name, in, out, first, rng);
    return std::make_unique<RenderBlock>(store, name, in, out, style_size, rng);
}

std::vector<std::string> names_of(const ResolutionLadder& ladder) {
    std::vector<std::string> names;
    for (const std::int64_t side : ladder.sides()) names.push_back(std::to_string(side));
    return names;
}

/// Render blocks on a feature map of few rays, one for each image, and the mask branch on their
/// features.
class RenderBlocks : public ImageStage {
public:
    RenderBlocks(const DecoderConfig& config, ResolutionLadder ladder, ParameterStore& store,
                 const std::string& prefix, std::int64_t style_size, Rng& rng)
        : config_(config),
          ladder_(std::move(ladder)),
          blocks_([&] {
              std::vector<std::unique_ptr<UpsampleBlock>> blocks;
              for (const std::string& name : names_of(ladder_))
                  blocks.push_back(make_block(config, store, prefix + ".block" + name,
                                              blocks.size(), style_size, rng));
              return blocks;
          }()),
          mask_(store, prefix + ".mask", std::span(config.block_channels).first(ladder_.count()),
                names_of(ladder_), config.mask_channels, rng) {}

    [[nodiscard]] std::int64_t rays_per_side(std::int64_t) const override {
        return config_.rays.rays_per_side;
    }
    [[nodiscard]] std::int64_t channels() const override { return config_.feature_channels; }
    [[nodiscard]] Variable feature_values(const Variable& composited) const override {
        return composited;
    }
    [[nodiscard]] Decoded images(const Variable& feature_map, const Variable& style,
                                 const DecodeOptions& options) const override;
    [[nodiscard]] Variable mask_of_rays(const Variable&, std::int64_t) const override { return {}; }
    [[nodiscard]] std::int64_t multiply_adds(std::int64_t resolution) const override;
    [[nodiscard]] LayerMemory memory(const DecodeOptions& options,
                                     std::int64_t images) const override;
    [[nodiscard]] std::vector<FoldedRenderBlock> folded_blocks(
        const Variable& style, std::int64_t resolution) const override;
    [[nodiscard]] FoldedMaskBranch folded_mask() const override { return mask_.folded(); }

private:
    DecoderConfig config_;
    ResolutionLadder ladder_;
    std::vector<std::unique_ptr<UpsampleBlock>> blocks_;  ///< for each image
    MaskBranch mask_;
};

Decoded RenderBlocks::images(const Variable& feature_map, const Variable& style,
                             const DecodeOptions& options) const {
    Decoded decoded;
    decoded.feature_map = feature_map;
    std::vector<Variable> features;
    Rendered rendered{feature_map, {}};
    for (std::size_t i = 0; i < ladder_.count_up_to(options.resolution); ++i) {
        rendered = (*blocks_[i])(rendered, style, options.recompute_blocks);
        decoded.images.push_back(tanh(rendered.rgb));
        if (options.mask)
            features.push_back(config_.mask_detach ? rendered.features.detach()
                                                   : rendered.features);
    }
    if (options.mask && options.recompute_blocks) {
        decoded.mask_logit = recompute(
            [mask = mask_](std::span<const Variable> inputs) { return mask(inputs); }, features);
    } else if (options.mask) {
        decoded.mask_logit = mask_(features);
    }
    return decoded;
}

std::int64_t RenderBlocks::multiply_adds(std::int64_t resolution) const {
    std::int64_t sum = 0;
    std::int64_t pixels = config_.rays.rays_per_side * config_.rays.rays_per_side;
    for (std::size_t i = 0; i < ladder_.count_up_to(resolution); ++i) {
        sum += pixels * blocks_[i]->multiply_adds();
        pixels *= 4;
    }
    return sum;
}

LayerMemory RenderBlocks::memory(const DecodeOptions& options, std::int64_t images) const {
    LayerMemory memory;
    const ResolutionLadder ladder = ladder_.up_to(options.resolution);
    for (std::size_t i = 0; i < ladder.count(); ++i)
        memory.add(blocks_[i]->memory(ladder.sides()[i], images, options.recompute_blocks));
    if (options.mask) memory.add(mask_.memory(ladder.sides(), images, options.recompute_blocks));
    return memory;
}

std::vector<FoldedRenderBlock> RenderBlocks::folded_blocks(const Variable& style,
                                                           std::int64_t resolution) const {
    std::vector<FoldedRenderBlock> blocks;
    for (std::size_t i = 0; i < ladder_.count_up_to(resolution); ++i)
        blocks.push_back(blocks_[i]->folded(style));
    return blocks;
}

/// One ray for each pixel of the largest image. Smaller images are that image downsampled. The mask
/// is the opacity.
class RaysAsImages : public ImageStage {
public:
    explicit RaysAsImages(ResolutionLadder ladder) : ladder_(std::move(ladder)) {}

    [[nodiscard]] std::int64_t rays_per_side(std::int64_t resolution) const override {
        return ladder_.up_to(resolution).largest();
    }
    [[nodiscard]] std::int64_t channels() const override { return 3; }
    [[nodiscard]] Variable feature_values(const Variable& composited) const override {
        return affine(composited, 2.0, -1.0);
    }
    [[nodiscard]] Decoded images(const Variable& image, const Variable& style,
                                 const DecodeOptions& options) const override;
    [[nodiscard]] Variable mask_of_rays(const Variable& transmittance,
                                        std::int64_t side) const override;
    [[nodiscard]] std::int64_t multiply_adds(std::int64_t) const override { return 0; }
    [[nodiscard]] LayerMemory memory(const DecodeOptions& options,
                                     std::int64_t images) const override;
    [[nodiscard]] std::vector<FoldedRenderBlock> folded_blocks(const Variable&,
                                                               std::int64_t) const override {
        fail<ValueError>("a decoder without render blocks has none to fold");
    }
    [[nodiscard]] FoldedMaskBranch folded_mask() const override {
        fail<ValueError>("a decoder without render blocks has no mask branch to fold");
    }

private:
    ResolutionLadder ladder_;
};

Decoded RaysAsImages::images(const Variable& image, const Variable&, const DecodeOptions&) const {
    Decoded decoded;
    decoded.feature_map = image;
    for (const std::int64_t side : ladder_.sides()) {
        if (side >= image.shape(1)) break;
        decoded.images.push_back(resize_box(image, static_cast<int>(side), static_cast<int>(side)));
    }
    decoded.images.push_back(image);
    return decoded;
}

Variable RaysAsImages::mask_of_rays(const Variable& transmittance, std::int64_t side) const {
    constexpr double lift = 1e-6;  // bounds the logit of a transparent or opaque ray
    const Variable logit = log(affine(transmittance, -1.0, 1.0) + lift) - log(transmittance + lift);
    return reshape(logit, {transmittance.shape(0), side, side, 1});
}

LayerMemory RaysAsImages::memory(const DecodeOptions& options, std::int64_t images) const {
    const std::int64_t side = rays_per_side(options.resolution);
    // Colours and opacity of each ray, with the values that the losses save for them.
    return {5 * 4 * images * side * side, 0};
}

}  // namespace

std::unique_ptr<ImageStage> make_image_stage(const DecoderConfig& config,
                                             const ResolutionLadder& ladder, ParameterStore& store,
                                             const std::string& prefix, std::int64_t style_size,
                                             Rng& rng) {
    if (config.render == "blocks")
        return std::make_unique<RenderBlocks>(config, ladder, store, prefix, style_size, rng);
    return std::make_unique<RaysAsImages>(ladder);
}

}  // namespace stymo
