#pragma once

#include <string>
#include <vector>

#include "core/rng.h"
#include "nn/layers/mask_branch.h"
#include "nn/layers/render_block.h"
#include "nn/models/codes.h"
#include "nn/models/decoder_config.h"
#include "nn/parameter_store.h"
#include "render/camera.h"
#include "render/composite.h"
#include "render/rays.h"

namespace stymo {

struct DecodeOptions {
    std::int64_t samples_per_ray = 32;
    /// Side of the largest image that is wanted, 0 for the model's resolution. Render blocks for
    /// larger sides are skipped.
    std::int64_t resolution = 0;
    bool mask = false;  ///< also computes the head mask, at the side of the largest image
    /// (B, rays, samples_per_ray), 0 where a sample is left out as if it were empty. If undefined,
    /// no sample is left out.
    Tensor significant_samples{};
    /// Samples of a smaller compositing weight get no gradient. With `orbits` they are left out of
    /// the image too.
    double gradient_tolerance = 0.0;
    /// Keeps the field's activations for the backward pass, layers * width numbers for each sample,
    /// instead of computing them again. Neither a field with concatenated codes nor one whose
    /// samples have a gradient_tolerance keeps them.
    bool keep_field = false;
    /// The backward pass computes the render blocks and the mask branch again, image by image,
    /// instead of keeping their activations. Results may differ by rounding.
    bool recompute_blocks = false;
    /// (B, 6), orbit parameters (render/tracked_rays.h) of the poses of the given cameras.
    /// Gradients flow to them. If undefined, there are no gradients of the poses. Much slower than
    /// without orbits; significant_samples reduce the cost.
    Variable orbits{};
    /// Random numbers for stratified samples (training); null: fixed samples.
    Rng* jitter = nullptr;
};

struct Decoded {
    /// (B, S, S, 3) in [-1, 1] for S = 64, 128, ... in ascending order.
    std::vector<Variable> images;
    Variable mask_logit;   ///< (B, S, S, 1) before the sigmoid, undefined unless asked for
    Variable feature_map;  ///< (B, 32, 32, feature_channels); without render blocks (B, S, S, 3),
                           ///< the largest image
    CompositeWeights weights;  ///< (B, 1024, N); without render blocks (B, S * S, N)
    RaySamples samples;
};

/// Multiply-adds of the matrix products for one image. They are nearly all of the arithmetic.
struct DecoderWork {
    std::int64_t rays = 0;
    FieldWork field;
    std::int64_t blocks = 0;  ///< all render blocks, on every pixel
};

/// The generator G of the paper: four mapping networks, a field of modulated sine layers, volume
/// rendering, render blocks and a mask branch. The configuration can also select the paper's
/// baselines: HeadNeRF's conditioning by concatenation, or a field that is rendered at full
/// resolution without render blocks. In the latter the mask is the opacity of the rays, and the
/// smaller images are the largest one downsampled.
class Decoder {
public:
    /// Creates parameters under `prefix`.{mapping,field,block64,...,mask}; their values depend on
    /// the state of `rng` and on their names alone. Throws ConfigError if `block_channels` has too
    /// few entries for the resolution, for an unknown choice and for choices that exclude each
    /// other.
    Decoder(const DecoderConfig& config, ParameterStore& store, const std::string& prefix,
            Rng& rng);
    ~Decoder();
    Decoder(Decoder&&) noexcept;

    [[nodiscard]] const DecoderConfig& config() const;
    [[nodiscard]] const ResolutionLadder& ladder() const;
    /// Maps codes from Z to W.
    [[nodiscard]] Codes map(const Codes& z) const;
    /// Renders each face with its camera; there is one camera for each row of `z`. Throws
    /// ShapeError for codes of other sizes or another number of cameras, and ValueError for a
    /// resolution that is not one of `ladder()`.
    [[nodiscard]] Decoded operator()(const Codes& z, const std::vector<Camera>& cameras,
                                     const DecodeOptions& options) const;
    /// Runs only the render blocks, on a feature map of an earlier result (edits of texture and
    /// light). Leaves weights and samples of the result undefined, and without render blocks the
    /// mask too. Throws ShapeError for a feature map of another shape.
    [[nodiscard]] Decoded decode_feature_map(const Variable& feature_map, const Codes& w,
                                             const DecodeOptions& options) const;
    /// Whether the layers can be folded for the fast renderer.
    [[nodiscard]] bool folds() const;
    /// The field's layers with the style of one face folded in, for a renderer. `w` has one row, in
    /// W. Throws ValueError unless `folds()`.
    [[nodiscard]] FoldedField folded_field(const Codes& w) const;
    /// The render blocks for an image of side `resolution` (0: the model's resolution) with the
    /// style of one face folded in. Throws ValueError unless `folds()`, or for a resolution that is
    /// not one of `ladder()`.
    [[nodiscard]] std::vector<FoldedRenderBlock> folded_blocks(const Codes& w,
                                                               std::int64_t resolution = 0) const;
    /// Throws ValueError without render blocks.
    [[nodiscard]] FoldedMaskBranch folded_mask() const;
    /// Decoded::weights.weights for samples at fixed positions, (B, rays, samples_per_ray), without
    /// computing features or images. Throws the same errors as decoding.
    [[nodiscard]] Tensor compositing_weights(const Codes& z, const std::vector<Camera>& cameras,
                                             std::int64_t samples_per_ray,
                                             std::int64_t resolution = 0) const;
    /// Density (B, P, 1) at points (B, P, 3) in world coordinates, for codes in W.
    [[nodiscard]] Variable density(const Variable& points, const Codes& w) const;
    /// The side of the rays of an image of this resolution (0: the model's resolution).
    [[nodiscard]] std::int64_t rays_per_side(std::int64_t resolution = 0) const;
    /// Arithmetic for one image of this resolution (0: the model's resolution).
    [[nodiscard]] DecoderWork work(std::int64_t resolution = 0) const;
    /// Memory for decoding this number of images at once with these options, including the loss on
    /// the images.
    [[nodiscard]] LayerMemory memory(const DecodeOptions& options, std::int64_t images) const;

private:
    struct Layers;
    std::unique_ptr<Layers> layers_;
};

}  // namespace stymo
