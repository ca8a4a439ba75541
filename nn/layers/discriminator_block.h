#pragma once

#include <cstdint>
#include <string>

#include "core/autograd/variable.h"
#include "nn/layer_memory.h"
#include "nn/layers/conv_layer.h"

namespace stymo {

/// StyleGAN2's minibatch standard deviation, which shows a discriminator how much the images of a
/// batch differ: x (B, H, W, C) -> (B, H, W, C + 1). The new channel is constant within each group
/// of G = `group_size` images. It is the standard deviation over the group, sqrt(variance + 1e-8)
/// with the population variance, averaged over pixels and channels. Images i, i + B / G, i + 2 B /
/// G, ... form a group. Throws ShapeError if the group size does not divide B.
[[nodiscard]] Variable append_minibatch_deviation(const Variable& x, std::int64_t group_size);

/// Residual block of StyleGAN2's discriminator, which halves the side: (main + skip) / sqrt(2).
/// Main path: 3x3 convolution, blur, 3x3 convolution with stride 2; both convolutions have leaky
/// ReLU (slope 0.2, gain sqrt(2)). Skip path: blur and 1x1 convolution with stride 2, without bias
/// or activation. The blur is [1,3,3,1] / 8 along each axis with zeros beyond the border. All
/// convolutions have an equalised learning rate.
class DiscriminatorBlock {
public:
    /// Creates `prefix`.{conv0,conv1}.{weight,bias} and `prefix`.skip.weight.
    DiscriminatorBlock(ParameterStore& store, const std::string& prefix, std::int64_t in,
                       std::int64_t out, Rng& rng);

    /// (B, S, S, in) -> (B, S / 2, S / 2, out) for an even S.
    [[nodiscard]] Variable operator()(const Variable& x) const;
    /// Memory for one image of side `side`.
    [[nodiscard]] static LayerMemory memory(std::int64_t in, std::int64_t out, std::int64_t side);

private:
    ConvLayer conv0_;
    ConvLayer conv1_;
    ConvLayer skip_;
};

}  // namespace stymo
