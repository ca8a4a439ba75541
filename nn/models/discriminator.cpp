#include "nn/models/discriminator.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/layers/conv_layer.h"
#include "nn/layers/discriminator_block.h"
#include "nn/layers/linear.h"
#include "nn/models/decoder_config.h"

namespace stymo {
namespace {

constexpr std::int64_t smallest_side = 64;
constexpr std::int64_t largest_image_side = 1024;
constexpr std::int64_t final_side = 4;
/// Blocks that every resolution shares: 32, 16 and 8 pixels.
constexpr std::size_t shared_blocks = 3;

std::int64_t channels_at(const DiscriminatorConfig& config, std::int64_t side) {
    constexpr double shared_channels = 512.0;
    const double full = config.channel_multiplier * 16384.0 / static_cast<double>(side);
    const auto channels = std::llround(side < smallest_side ? shared_channels : full);
    return std::clamp<std::int64_t>(channels, 1, config.max_channels);
}

std::string block_name(const std::string& prefix, std::int64_t side) {
    return prefix + ".block" + std::to_string(side);
}
std::string from_rgb_name(const std::string& prefix, std::int64_t side) {
    return prefix + ".from_rgb" + std::to_string(side);
}
std::string epilogue_name(const std::string& prefix) {
    return prefix + ".epilogue";
}

}  // namespace

void describe(ConfigSchema& schema, DiscriminatorConfig& config) {
    schema.number("discriminator.channel_multiplier", config.channel_multiplier, 1e-3, 16.0,
                  "2: 512, 256, 128, 64 channels at 64, 128, 256, 512 pixels (paper: silent; "
                  "StyleGAN2 has 2)");
    schema.integer("discriminator.max_channels", config.max_channels, 1, 4096,
                   "largest number of channels of a layer (paper: silent; StyleGAN2 has 512)");
    schema.integer(
        "discriminator.group_size", config.group_size, 1, 65536,
        "images that share a minibatch standard deviation (paper: silent; StyleGAN2 has 4)");
}

struct Discriminator::Layers {
    ResolutionLadder ladder;
    std::int64_t group_size;
    std::vector<ConvLayer> from_rgb;         ///< one for each side of the ladder
    std::vector<DiscriminatorBlock> blocks;  ///< for 8, 16, ...
    ConvLayer epilogue;
    Linear hidden;
    Linear logit;

    Layers(const DiscriminatorConfig& config, const ResolutionLadder& sides, ParameterStore& store,
           const std::string& prefix, Rng& rng);
    [[nodiscard]] Variable colours(const Variable& images, std::size_t phase) const {
        return from_rgb[phase](images, 0.2);
    }
};

Discriminator::Layers::Layers(const DiscriminatorConfig& config, const ResolutionLadder& sides,
                              ParameterStore& store, const std::string& prefix, Rng& rng)
    : ladder(sides),
      group_size(config.group_size),
      epilogue(store, epilogue_name(prefix) + ".conv", channels_at(config, final_side) + 1,
               channels_at(config, final_side),
               {.scaling = WeightScaling::equalised, .gain = std::numbers::sqrt2}, rng),
      hidden(store, epilogue_name(prefix) + ".hidden",
             final_side * final_side * channels_at(config, final_side),
             channels_at(config, final_side), {.activation = Activation::leaky_relu}, rng),
      logit(store, epilogue_name(prefix) + ".logit", channels_at(config, final_side), 1, {}, rng) {
    for (std::int64_t s = 2 * final_side; s <= ladder.largest(); s *= 2)
        blocks.emplace_back(store, block_name(prefix, s), channels_at(config, s),
                            channels_at(config, s / 2), rng);
    const ConvLayerOptions pointwise{.kernel = 1,
                                     .padding = 0,
                                     .scaling = WeightScaling::equalised,
                                     .gain = std::numbers::sqrt2};
    for (const std::int64_t s : ladder.sides())
        from_rgb.emplace_back(store, from_rgb_name(prefix, s), 3, channels_at(config, s), pointwise,
                              rng);
}

namespace {

ResolutionLadder ladder_to(std::int64_t resolution) {
    try {
        static_cast<void>(ResolutionLadder(smallest_side, largest_image_side).up_to(resolution));
        return {smallest_side, resolution};
    } catch (const ValueError&) {
        fail<ConfigError>("a discriminator needs a resolution of 64, 128, 256, 512 or 1024, got ",
                          resolution);
    }
}

}  // namespace

Discriminator::Discriminator(const DiscriminatorConfig& config, std::int64_t resolution,
                             ParameterStore& store, const std::string& prefix, Rng& rng)
    : layers_(std::make_unique<Layers>(config, ladder_to(resolution), store, prefix, rng)) {}
Discriminator::~Discriminator() = default;
Discriminator::Discriminator(Discriminator&&) noexcept = default;

std::int64_t Discriminator::resolution() const {
    return layers_->ladder.largest();
}

std::int64_t Discriminator::multiply_adds(const DiscriminatorConfig& config, std::int64_t side) {
    constexpr std::int64_t taps = 3 * 3, final_pixels = final_side * final_side;
    const std::int64_t last = channels_at(config, final_side);
    std::int64_t work = side * side * 3 * channels_at(config, side);
    for (std::int64_t s = side; s > final_side; s /= 2) {
        const std::int64_t in = channels_at(config, s), out = channels_at(config, s / 2);
        // The first convolution, then the second and the skip at half the side.
        work += s * s * taps * in * in + s / 2 * (s / 2) * (taps + 1) * in * out;
    }
    return work + final_pixels * taps * (last + 1) * last + final_pixels * last * last + last;
}

LayerMemory Discriminator::memory(const DiscriminatorConfig& config, std::int64_t side,
                                  std::int64_t images) {
    LayerMemory memory;
    for (std::int64_t s = 2 * final_side; s <= side; s *= 2) {
        const LayerMemory one =
            DiscriminatorBlock::memory(channels_at(config, s), channels_at(config, s / 2), s);
        memory.add({images * one.saved, images * one.transient});
    }
    return memory;
}

std::int64_t Discriminator::element_count(const DiscriminatorConfig& config,
                                          std::int64_t resolution) {
    const std::int64_t last = channels_at(config, final_side);
    std::int64_t weights = (9 + final_side * final_side) * last * last;
    for (std::int64_t s = 2 * final_side; s <= resolution; s *= 2) {
        const std::int64_t in = channels_at(config, s), out = channels_at(config, s / 2);
        weights += 9 * in * in + 10 * in * out + 3 * in;
    }
    return weights;
}

std::vector<std::string> Discriminator::prefixes_of(const std::string& prefix, std::int64_t side) {
    std::vector<std::string> prefixes{from_rgb_name(prefix, side) + ".",
                                      block_name(prefix, side) + "."};
    if (side > smallest_side) return prefixes;
    for (std::int64_t s = 2 * final_side; s < smallest_side; s *= 2)
        prefixes.push_back(block_name(prefix, s) + ".");
    prefixes.push_back(epilogue_name(prefix) + ".");
    return prefixes;
}

Variable Discriminator::operator()(const Variable& images, double fade) const {
    const bool square =
        images.rank() == 4 && images.shape(1) == images.shape(2) && images.shape(3) == 3;
    const std::vector<std::int64_t>& sides = layers_->ladder.sides();
    const auto found = square ? std::ranges::find(sides, images.shape(1)) : sides.end();
    if (found == sides.end()) {
        fail<ShapeError>("the discriminator takes square RGB images with a side of ",
                         layers_->ladder.text(), ", got ", images.shape());
    }
    const auto phase = static_cast<std::size_t>(found - sides.begin());
    if (!(fade >= 0.0 && fade <= 1.0))
        fail<ValueError>("the discriminator's fade must be in [0, 1], got ", fade);
    if (fade < 1.0 && phase == 0)
        fail<ValueError>("the discriminator has no smaller block to fade from at ", smallest_side,
                         " pixels");

    std::size_t block = phase + shared_blocks;
    Variable x = layers_->blocks[block](layers_->colours(images, phase));
    if (fade < 1.0) {
        const auto half = static_cast<int>(images.shape(1) / 2);
        const Variable coarse = layers_->colours(resize_box(images, half, half), phase - 1);
        x = coarse * (1.0 - fade) + x * fade;
    }
    while (block > 0) x = layers_->blocks[--block](x);
    x = append_minibatch_deviation(x, std::min(layers_->group_size, x.shape(0)));
    x = layers_->epilogue(x, 0.2);
    return layers_->logit(layers_->hidden(reshape(x, {x.shape(0), -1})));
}

}  // namespace stymo
