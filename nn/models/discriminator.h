#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "core/config.h"
#include "core/rng.h"
#include "nn/layer_memory.h"
#include "nn/parameter_store.h"

namespace stymo {

struct DiscriminatorConfig {
    /// With 2, the sides 64, 128, 256, 512 have 512, 256, 128, 64 channels; with 1, half as many.
    double channel_multiplier = 2.0;
    std::int64_t max_channels = 512;  ///< upper limit for every layer
    std::int64_t group_size = 4;      ///< images that share a minibatch standard deviation
};

/// Binds the fields under "discriminator." .
void describe(ConfigSchema& schema, DiscriminatorConfig& config);

/// StyleGAN2's residual discriminator (Karras et al. 2020), with one fromRGB for each resolution,
/// for progressive growing.
class Discriminator {
public:
    /// Creates parameters under `prefix`: fromRGB and a block for each side 64, 128, ... up to
    /// `resolution`, and the layers that all sides share. Throws ConfigError if `resolution` is not
    /// one of these sides.
    Discriminator(const DiscriminatorConfig& config, std::int64_t resolution, ParameterStore& store,
                  const std::string& prefix, Rng& rng);
    ~Discriminator();
    Discriminator(Discriminator&&) noexcept;

    /// images (B, S, S, 3) in [-1, 1] for S = 64, 128, ... up to the resolution -> logits (B, 1),
    /// high for real images. If `fade` < 1, the block of side S is being faded in: its features are
    /// mixed with fromRGB of the image downsampled to S / 2 (box filter), which has the weight 1 -
    /// fade. Throws ShapeError for another side, or if the group size (at most B) does not divide
    /// B; ValueError for a fade outside [0, 1], or below 1 at 64 pixels, where there is nothing to
    /// fade from.
    [[nodiscard]] Variable operator()(const Variable& images, double fade = 1.0) const;

    [[nodiscard]] std::int64_t resolution() const;
    /// Memory for this number of images of this side.
    [[nodiscard]] static LayerMemory memory(const DiscriminatorConfig& config, std::int64_t side,
                                            std::int64_t images);
    /// Multiply-adds of one forward pass on one image of this side.
    [[nodiscard]] static std::int64_t multiply_adds(const DiscriminatorConfig& config,
                                                    std::int64_t side);
    /// Approximate number of parameters.
    [[nodiscard]] static std::int64_t element_count(const DiscriminatorConfig& config,
                                                    std::int64_t resolution);
    /// Name prefixes of the parameters that images of this side use and smaller images do not: the
    /// parameters that the progressive phase of this side adds.
    [[nodiscard]] static std::vector<std::string> prefixes_of(const std::string& prefix,
                                                              std::int64_t side);

private:
    struct Layers;
    std::unique_ptr<Layers> layers_;
};

}  // namespace stymo
