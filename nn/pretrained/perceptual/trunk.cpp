#include "nn/pretrained/perceptual/trunk.h"

#include <algorithm>

#include "core/ops/ops.h"

namespace stymo {
namespace {

using Kind = TrunkLayer::Kind;

constexpr bool tap = true;

TrunkLayer conv(int index, std::int64_t out, bool is_tap = false, int kernel = 3, int stride = 1,
                int padding = 1) {
    return {.kind = Kind::convolution,
            .index = index,
            .out = out,
            .kernel = kernel,
            .stride = stride,
            .padding = padding,
            .tap = is_tap};
}
TrunkLayer fire(int index, std::int64_t squeezed, std::int64_t out, bool is_tap = false) {
    return {.kind = Kind::fire, .index = index, .out = out, .squeezed = squeezed, .tap = is_tap};
}
TrunkLayer pool(int index, int kernel) {
    return {.kind = Kind::max_pool, .index = index, .kernel = kernel, .stride = 2};
}

TrunkDescription vgg16() {
    return {.name = "vgg16",
            .weights_file = "vgg16-397923af.pth",
            .heads_name = "vgg",
            .layers = {conv(0, 64), conv(2, 64, tap), pool(4, 2),                      //
                       conv(5, 128), conv(7, 128, tap), pool(9, 2),                    //
                       conv(10, 256), conv(12, 256), conv(14, 256, tap), pool(16, 2),  //
                       conv(17, 512), conv(19, 512), conv(21, 512, tap), pool(23, 2),  //
                       conv(24, 512), conv(26, 512), conv(28, 512, tap)},
            .alive_per_pixel = 800};
}

TrunkDescription alexnet() {
    return {.name = "alexnet",
            .weights_file = "alexnet-owt-7be5be79.pth",
            .heads_name = "alex",
            .layers = {conv(0, 64, tap, 11, 4, 2), pool(2, 3),  //
                       conv(3, 192, tap, 5, 1, 2), pool(5, 3),  //
                       conv(6, 384, tap), conv(8, 256, tap), conv(10, 256, tap)},
            .alive_per_pixel = 60};
}

TrunkDescription squeezenet() {
    return {.name = "squeezenet1_1",
            .weights_file = "squeezenet1_1-b8a52dc0.pth",
            .heads_name = "squeeze",
            .pool_ceil_mode = true,
            .layers = {conv(0, 64, tap, 3, 2, 0), pool(2, 3),                //
                       fire(3, 16, 128), fire(4, 16, 128, tap), pool(5, 3),  //
                       fire(6, 32, 256), fire(7, 32, 256, tap), pool(8, 3),  //
                       fire(9, 48, 384, tap), fire(10, 48, 384, tap),        //
                       fire(11, 64, 512, tap), fire(12, 64, 512, tap)},
            .alive_per_pixel = 150};
}

ConvLayerOptions options_of(const TrunkLayer& layer) {
    return {.kernel = layer.kernel, .stride = layer.stride, .padding = layer.padding};
}

ConvLayerOptions pointwise() {
    return {.kernel = 1, .padding = 0};
}

/// Side of the output of a convolution or a pool, 0 if it is empty.
std::int64_t side_after(const TrunkLayer& layer, bool pool_ceil_mode, std::int64_t side) {
    if (layer.kind == Kind::fire) return side;
    const std::int64_t rest = side + 2 * layer.padding - layer.kernel;
    const bool ceil = layer.kind == Kind::max_pool && pool_ceil_mode;
    if (rest < (ceil ? 1 - layer.stride : 0)) return 0;
    return (rest + (ceil ? layer.stride - 1 : 0)) / layer.stride + 1;
}

}  // namespace

const std::vector<TrunkDescription>& trunk_descriptions() {
    static const std::vector<TrunkDescription> all{vgg16(), alexnet(), squeezenet()};
    return all;
}

std::vector<std::int64_t> tap_channels(const TrunkDescription& description) {
    std::vector<std::int64_t> channels;
    for (const TrunkLayer& layer : description.layers)
        if (layer.tap) channels.push_back(layer.out);
    return channels;
}

std::int64_t trunk_multiply_adds(const std::string& network, std::int64_t side) {
    const auto& all = trunk_descriptions();
    const auto description = std::ranges::find(all, network, &TrunkDescription::name);
    std::int64_t work = 0, channels = 3;
    for (const TrunkLayer& layer : description->layers) {
        if (layer.kind == Kind::fire) {
            // 1x1 to the squeezed channels, then 1x1 and 3x3 to half of the output each.
            constexpr std::int64_t taps = 1 + 3 * 3;
            work += side * side * layer.squeezed * (channels + taps * layer.out / 2);
        } else {
            side = (side + 2 * layer.padding - layer.kernel) / layer.stride + 1;
            if (layer.kind == Kind::max_pool) continue;
            work += side * side * layer.kernel * layer.kernel * channels * layer.out;
        }
        channels = layer.out;
    }
    return work;
}

Trunk::Trunk(const TrunkDescription& description, ParameterStore& store, const std::string& prefix,
             Rng& rng)
    : pool_ceil_mode_(description.pool_ceil_mode) {
    std::int64_t in = 3;
    for (const TrunkLayer& layer : description.layers) {
        const std::string name = prefix + "features." + std::to_string(layer.index);
        Stage stage{layer, {}};
        if (layer.kind == Kind::convolution) {
            stage.convolutions.emplace_back(store, name, in, layer.out, options_of(layer), rng);
        } else if (layer.kind == Kind::fire) {
            stage.convolutions.emplace_back(store, name + ".squeeze", in, layer.squeezed,
                                            pointwise(), rng);
            stage.convolutions.emplace_back(store, name + ".expand1x1", layer.squeezed,
                                            layer.out / 2, pointwise(), rng);
            stage.convolutions.emplace_back(store, name + ".expand3x3", layer.squeezed,
                                            layer.out / 2, ConvLayerOptions{}, rng);
        }
        if (layer.kind != Kind::max_pool) in = layer.out;
        stages_.push_back(std::move(stage));
    }
}

Variable Trunk::apply(const Stage& stage, const Variable& x) const {
    const std::vector<ConvLayer>& layers = stage.convolutions;
    switch (stage.layer.kind) {
        case Kind::convolution: return layers[0](x, 0.0);
        case Kind::fire: {
            const Variable squeezed = layers[0](x, 0.0);
            return relu(concat({layers[1](squeezed), layers[2](squeezed)}, 3));
        }
        case Kind::max_pool: break;
    }
    return max_pool2d(
        x,
        {.kernel = stage.layer.kernel, .stride = stage.layer.stride, .ceil_mode = pool_ceil_mode_});
}

std::vector<Variable> Trunk::operator()(const Variable& images) const {
    std::vector<Variable> taps;
    Variable x = images;
    for (const Stage& stage : stages_) {
        x = apply(stage, x);
        if (stage.layer.tap) taps.push_back(x);
    }
    return taps;
}

std::int64_t Trunk::smallest_side() const {
    for (std::int64_t side = 1;; ++side) {
        std::int64_t left = side;
        for (const Stage& stage : stages_)
            left = left == 0 ? 0 : side_after(stage.layer, pool_ceil_mode_, left);
        if (left > 0) return side;
    }
}

}  // namespace stymo
