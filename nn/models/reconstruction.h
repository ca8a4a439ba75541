#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "nn/models/encoder.h"
#include "nn/models/model.h"
#include "nn/pretrained/perceptual/feature_distance.h"
#include "nn/pretrained/perceptual/lpips.h"

namespace stymo {

/// A perceptual distance that needs no published weights: activations of the model's own encoder
/// are compared as in LPIPS, but all channel weights are 1 and the result is the mean over the
/// layers.
class EncoderDistance final : public PerceptualDistance {
public:
    /// The encoder must outlive this object. Throws ConfigError unless the backbone has
    /// activations.
    explicit EncoderDistance(const Encoder& encoder);

    [[nodiscard]] Features features(const Variable& images) const override;
    [[nodiscard]] Variable distance_to(const Variable& images,
                                       const Features& target) const override;
    [[nodiscard]] LayerMemory memory(std::int64_t side) const override;
    [[nodiscard]] std::string label() const override { return "the model's encoder"; }

private:
    const Backbone& backbone_;
};

/// L_recon of the paper: photometric and perceptual distance between rendered faces and photos.
/// Both training stages and fitting use it.
class ReconstructionLoss {
public:
    /// Loads the perceptual network unless its weight is 0. `off_switch` tells the user in error
    /// messages how to turn the perceptual term off. `encoder` is the model's frozen encoder and
    /// must outlive the loss; it is required if the configuration makes it the perceptual network.
    /// Throws what `Lpips` throws, and ConfigError for a perceptual resolution that is not a power
    /// of two.
    explicit ReconstructionLoss(
        const ReconstructionConfig& config,
        const std::string& off_switch = "reconstruction.perceptual_weight = 0",
        const Encoder* encoder = nullptr);

    /// Photos on a black background, with values that are computed from them only once.
    struct Target {
        std::vector<Tensor> images;  ///< (B, s, s, 3) in [-1, 1], background -1, for s = 64, 128,
                                     ///< ... up to the resolution R
        /// Weights of the photometric loss, at least one for each image.
        std::vector<double> weights;
        /// Perceptual features of each face's largest image, reduced to the perceptual resolution.
        /// If empty, they are computed for one face at a time when needed, and not kept.
        std::vector<PerceptualDistance::Features> features;
        /// The known pixels of each image (nn/known_pixels.h); empty: all are. In place of unknown
        /// ones both terms see the rendered image itself, as a constant.
        std::vector<Tensor> known{};
    };
    /// A target that is used once: `images` up to the side `resolution` (0: all of them), without
    /// features. `known` (B, S, S, 1) of any side S.
    [[nodiscard]] Target target(std::span<const Tensor> images, std::int64_t resolution = 0,
                                const Tensor& known = {}) const;
    /// A target that is used many times: all `images`, with the features of the largest ones if
    /// there is a perceptual term and all pixels are known.
    [[nodiscard]] Target kept_target(std::span<const Tensor> images,
                                     const Tensor& known = {}) const;

    struct Terms {
        Variable total;        ///< weighted sum of both terms, a scalar: mean over the batch
        Variable photometric;  ///< without its weight
        Variable perceptual;   ///< without its weight; undefined if that is 0
    };
    /// `images` as in Decoded::images, one for each image of the target.
    [[nodiscard]] Terms operator()(const std::vector<Variable>& images, const Target& target) const;
    /// One of the terms alone, without its weight; a term whose weight is 0 must not be asked for.
    [[nodiscard]] Variable photometric(const std::vector<Variable>& images,
                                       const Target& target) const;
    [[nodiscard]] Variable perceptual(const std::vector<Variable>& images,
                                      const Target& target) const;
    [[nodiscard]] double photometric_weight() const { return config_.photometric_weight; }
    [[nodiscard]] double perceptual_weight() const;

    /// Memory of the perceptual term for images up to this side. Decoder::memory includes the
    /// photometric term.
    [[nodiscard]] LayerMemory memory(std::int64_t side) const;

    /// Null if there is no perceptual term, and if its network is the encoder.
    [[nodiscard]] const Lpips* lpips() const { return lpips_ ? &*lpips_ : nullptr; }
    [[nodiscard]] Lpips* lpips() { return lpips_ ? &*lpips_ : nullptr; }

private:
    /// Null if there is no perceptual term.
    [[nodiscard]] const PerceptualDistance* network() const;

    ReconstructionConfig config_;
    std::optional<Lpips> lpips_;
    std::optional<EncoderDistance> encoder_distance_;
};

}  // namespace stymo
