#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "nn/models/model.h"
#include "nn/models/perceptual/encoder_distance.h"
#include "nn/models/perceptual/lpips.h"

namespace stymo {

/// L_recon of the paper: what makes a rendered face equal a photo, in both training stages and in
/// fitting alike.
class ReconstructionLoss {
public:
    /// Loads the perceptual network unless its weight is 0; throws what `Lpips` throws, and
    /// ConfigError for a perceptual resolution that is no power of two. `off_switch`: how the user
    /// turns the perceptual term off. `encoder`: the model's, frozen, which must outlive the loss;
    /// needed where it is the perceptual network.
    explicit ReconstructionLoss(
        const ReconstructionConfig& config,
        const std::string& off_switch = "reconstruction.perceptual_weight = 0",
        const Encoder* encoder = nullptr);

    /// Photos on black with what is computed of them only once.
    struct Target {
        std::vector<Tensor> images;   ///< (B, s, s, 3) in [-1, 1], background -1, for s = 64, 128,
                                      ///< ... up to the resolution R
        std::vector<double> weights;  ///< of the photometric loss, at least one for each image
        /// Of each face's largest image, or of what it is reduced to; empty: computed where they
        /// are needed, one face at a time, and let go again.
        std::vector<PerceptualDistance::Features> features;
    };
    /// `images` up to the side `resolution` (0: all of them), without features: for a target that
    /// is used once.
    [[nodiscard]] Target target(std::span<const Tensor> images, std::int64_t resolution = 0) const;
    /// All `images`, with the features of the largest ones if there is a perceptual term: for a
    /// target that stays the same.
    [[nodiscard]] Target kept_target(std::span<const Tensor> images) const;

    struct Terms {
        Variable total;        ///< weighted sum, a scalar: mean over the batch
        Variable photometric;  ///< without its weight
        Variable perceptual;   ///< without its weight; undefined if that is 0
    };
    /// `images` as the decoder gives them, as many as the target has images.
    [[nodiscard]] Terms operator()(const std::vector<Variable>& images, const Target& target) const;

    /// For the loss on images up to this side, what the decoder's report holds aside.
    [[nodiscard]] LayerMemory memory(std::int64_t side) const;

    /// Null without the perceptual term, and where the encoder is its network.
    [[nodiscard]] const Lpips* lpips() const { return lpips_ ? &*lpips_ : nullptr; }
    [[nodiscard]] Lpips* lpips() { return lpips_ ? &*lpips_ : nullptr; }

private:
    /// Null without the perceptual term.
    [[nodiscard]] const PerceptualDistance* perceptual() const;

    ReconstructionConfig config_;
    std::optional<Lpips> lpips_;
    std::optional<EncoderDistance> encoder_distance_;
};

}  // namespace stymo
