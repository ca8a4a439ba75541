#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/rng.h"
#include "nn/layers/conv_layer.h"
#include "nn/parameter_store.h"

namespace stymo {

/// A network that finds the head (face, hair, ears, glasses; neither hat nor hand nor neck) in an
/// aligned photo: a U-Net (Ronneberger et al. 2015) of 3x3 convolutions whose finest level has a
/// quarter of the image's side. For 256 x 256 pixels it has 0.66 million parameters and 0.27
/// billion multiply-adds.
class HeadMaskNetwork {
public:
    /// Side of the images for which networks are trained.
    static constexpr std::int64_t usual_side = 256;
    /// Sides of images are multiples of this.
    static constexpr std::int64_t side_divisor = 32;

    /// Creates the parameters under `prefix`, which ends with a dot.
    HeadMaskNetwork(ParameterStore& store, const std::string& prefix, Rng& rng);

    /// Images (B, S, S, 3) in [0, 1] in FFHQ's alignment -> logits (B, S, S, 1) that a pixel
    /// belongs to the head. The result does not depend on the contrast and brightness of an image.
    /// Throws ShapeError for other images or if `side_divisor` does not divide S.
    [[nodiscard]] Variable operator()(const Variable& images) const;

private:
    struct Descent {
        ConvLayer down;
        std::vector<ConvLayer> pair;
    };
    struct Ascent {
        ConvLayer lateral;  ///< to the channels of the finer level, before upsampling
        ConvLayer mix;
    };

    ConvLayer stem_;
    ConvLayer stem_mix_;
    std::vector<Descent> descents_;
    std::vector<Ascent> ascents_;  ///< from coarse to fine
    ConvLayer answer_;
};

/// A head-mask network with its weights. Copies share them.
struct HeadMaskModel {
    std::shared_ptr<ParameterStore> store;
    HeadMaskNetwork network;
};

/// A model with random weights.
[[nodiscard]] HeadMaskModel make_head_mask_model(Rng rng);
/// Throws FileError for a file that was not written by `write_head_mask_model`, or by a version of
/// stymo with another network.
[[nodiscard]] HeadMaskModel read_head_mask_model(const std::filesystem::path& path);
/// Writes a .safetensors file with 16 bits per weight, whole or not at all.
void write_head_mask_model(const std::filesystem::path& path, const HeadMaskModel& model);

/// The probability (S, S, 1) that a pixel of an aligned crop (S, S, 3) in [0, 1], of any side,
/// belongs to the head: the mean for the crop at the side `seen`, a multiple of `side_divisor`, and
/// for its mirror image.
[[nodiscard]] Tensor head_probability(const HeadMaskModel& model, const Tensor& crop,
                                      std::int64_t seen = HeadMaskNetwork::usual_side);

/// Mean binary cross-entropy of logits against masks in [0, 1] over the pixels that are known.
/// `known` has the weight of each pixel, 0 for a pixel whose label counts for nothing. All three
/// have the same shape. 0 if no pixel is known.
[[nodiscard]] Variable known_mask_loss(const Variable& logit, const Tensor& mask,
                                       const Tensor& known);

}  // namespace stymo
