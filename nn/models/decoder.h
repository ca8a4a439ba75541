#pragma once

#include <string>
#include <vector>

#include "core/config.h"
#include "core/rng.h"
#include "nn/layers/mask_branch.h"
#include "nn/layers/render_block.h"
#include "nn/models/codes.h"
#include "nn/models/field.h"
#include "nn/models/resolution_ladder.h"
#include "nn/parameter_store.h"
#include "render/camera.h"
#include "render/composite.h"
#include "render/rays.h"

namespace stymo {

/// The decoder; the defaults are the paper's, and those of docs/paper-notes.md where it is silent.
struct DecoderConfig {
    std::int64_t resolution = 512;  ///< side of the largest image: 64, 128, 256 or 512
    std::string conditioning =
        "modulation";  ///< "modulation", or "concatenation" as in HeadNeRF (nn/models/field.h)
    /// "blocks": render blocks make the image from a feature map of few rays; "none": one ray for
    /// each pixel has its colour.
    std::string render = "blocks";
    std::int64_t field_width = 256;  ///< channels of the field's layers
    std::int64_t field_layers =
        8;  ///< layers before the density head; the encoding enters again in the middle
    std::int64_t feature_channels = 256;  ///< d_f, channels of the rendered feature map
    std::int64_t frequencies = 10;        ///< of the positional encoding
    /// The first weights of frequency 2^k are multiplied by 2^(-k falloff), so that training opens
    /// the encoding from coarse to fine.
    double frequency_falloff = 0.0;
    /// One for each upsampling from 64 on; further ones are left unused.
    std::vector<std::int64_t> block_channels{128, 64, 32, 32};
    std::int64_t mask_channels = 16;
    bool mask_detach =
        false;  ///< keeps the mask loss from the render blocks: it trains the mask branch alone
    std::int64_t mapping_layers = 4;  ///< 0: W is Z
    double mapping_learning_rate_multiplier = 1.0;
    std::string depth_planes = "world_z";  ///< "world_z" or "optical_axis"; decides rays.planes
    /// rays_per_side is half of the first image's side, and the side of the feature map where there
    /// are render blocks; DecodeOptions decides the samples.
    RaySampling rays;
};

/// Binds the fields under "decoder." .
void describe(ConfigSchema& schema, DecoderConfig& config);

/// The sides of the decoder's images: from twice `rays_per_side` up to `resolution`. Throws
/// ConfigError where doubling does not lead there or a render block lacks its channels.
[[nodiscard]] ResolutionLadder resolution_ladder(const DecoderConfig& config);

struct DecodeOptions {
    std::int64_t samples_per_ray = 32;
    std::int64_t resolution =
        0;              ///< largest image wanted, 0 for the model's own; later blocks are left out
    bool mask = false;  ///< also the head mask, at the side of the largest image
    /// (B, rays, samples_per_ray), 0 where a sample is left out as if it were empty; undefined:
    /// none is.
    Tensor significant_samples{};
    /// Samples of a smaller weight take no part in the backward pass.
    double gradient_tolerance = 0.0;
    /// Keeps what the backward pass needs of the field, layers * width numbers for each sample,
    /// instead of computing it once more. A field with concatenated codes keeps nothing either way.
    bool keep_field = false;
    /// The backward pass computes the render blocks with the mask branch once more, image by image,
    /// instead of keeping what it needs of them. Changes results by rounding.
    bool recompute_blocks = false;
    /// (B, 6), orbit parameters (render/tracked_rays.h) of the very poses of the cameras, which
    /// gradients flow to; undefined: to none. Much slower than without; significant_samples decide
    /// by how much.
    Variable orbits{};
    Rng* jitter = nullptr;  ///< stratified samples (training); null: fixed samples
};

struct Decoded {
    std::vector<Variable>
        images;            ///< (B, S, S, 3) in [-1, 1] for S = 64, 128, ... in ascending order
    Variable mask_logit;   ///< (B, S, S, 1) before the sigmoid, undefined unless asked for
    Variable feature_map;  ///< (B, 32, 32, feature_channels); without render blocks (B, S, S, 3),
                           ///< the largest image
    CompositeWeights weights;  ///< (B, 1024, N); without render blocks (B, S * S, N)
    RaySamples samples;
};

/// Multiply-adds of the matrix products for one image, which are nearly all of the arithmetic.
struct DecoderWork {
    std::int64_t rays = 0;
    FieldWork field;
    std::int64_t blocks = 0;  ///< all render blocks, on every pixel
};

/// G of the paper: four mapping networks, the modulated sine field, volume rendering, render
/// blocks, mask branch. With other choices in its configuration it is what the paper compares with:
/// HeadNeRF's conditioning, or a field that is rendered at full resolution, whose mask is the
/// opacity of its rays and whose smaller images are the largest one, shrunk.
class Decoder {
public:
    /// Creates parameters under `prefix`.{mapping,field,block64,...,mask}; their values depend on
    /// the state of `rng` and on their names alone. Throws ConfigError for a resolution that the
    /// channels do not reach, and for choices that exclude each other.
    Decoder(const DecoderConfig& config, ParameterStore& store, const std::string& prefix,
            Rng& rng);
    ~Decoder();
    Decoder(Decoder&&) noexcept;

    [[nodiscard]] const DecoderConfig& config() const;
    [[nodiscard]] const ResolutionLadder& ladder() const;
    /// Z to W.
    [[nodiscard]] Codes map(const Codes& z) const;
    /// The image of each face through its camera. One camera for each row of the codes. Throws
    /// ShapeError where they do not fit and ValueError for a resolution that is not one of the
    /// model's.
    [[nodiscard]] Decoded operator()(const Codes& z, const std::vector<Camera>& cameras,
                                     const DecodeOptions& options) const;
    /// The render blocks alone, on a feature map that is reused (texture and light edits). Leaves
    /// weights and samples of the result undefined, without render blocks the mask too.
    [[nodiscard]] Decoded decode_feature_map(const Variable& feature_map, const Codes& w,
                                             const DecodeOptions& options) const;
    /// Whether the fast renderer knows these layers.
    [[nodiscard]] bool folds() const;
    /// The layers as they are for one face, with codes (1, ...) in W: what a renderer computes
    /// with. Throw ValueError unless it folds.
    [[nodiscard]] FoldedField folded_field(const Codes& w) const;
    /// Those of an image of this side, 0 for the model's own. Throws ValueError for one that is not
    /// one of the model's.
    [[nodiscard]] std::vector<FoldedRenderBlock> folded_blocks(const Codes& w,
                                                               std::int64_t resolution = 0) const;
    [[nodiscard]] FoldedMaskBranch folded_mask() const;
    /// Decoded::weights.weights of an image with samples at fixed places, (B, rays,
    /// samples_per_ray), and no more than they take. Throws what decoding throws.
    [[nodiscard]] Tensor compositing_weights(const Codes& z, const std::vector<Camera>& cameras,
                                             std::int64_t samples_per_ray,
                                             std::int64_t resolution = 0) const;
    /// Density at points (B, P, 3) for codes in W: (B, P, 1).
    [[nodiscard]] Variable density(const Variable& points, const Codes& w) const;
    /// What an image of this resolution takes, 0: the model's own.
    [[nodiscard]] DecoderWork work(std::int64_t resolution = 0) const;
    /// What decoding so many images at once with these options needs, the loss on the images
    /// included.
    [[nodiscard]] LayerMemory memory(const DecodeOptions& options, std::int64_t images) const;

private:
    struct Layers;
    std::unique_ptr<Layers> layers_;
};

}  // namespace stymo
