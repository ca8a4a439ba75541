#pragma once

#include <cstdint>
#include <string>

#include "nn/layer_memory.h"
#include "nn/layers/conv_layer.h"

namespace stymo {

/// Residual block of StyleGAN2's discriminator, which halves the side: 3x3 convolution, blur and
/// 3x3 convolution with stride 2, each with leaky ReLU (slope 0.2, gain sqrt(2)); beside it blur
/// and 1x1 convolution with stride 2, without bias or activation; (main + skip) / sqrt(2). The blur
/// is [1,3,3,1] / 8 along each axis with zeros beyond the border; equalised learning rate.
class DiscriminatorBlock {
public:
    /// Creates `prefix`.{conv0,conv1}.{weight,bias} and `prefix`.skip.weight.
    DiscriminatorBlock(ParameterStore& store, const std::string& prefix, std::int64_t in,
                       std::int64_t out, Rng& rng);

    /// (B, S, S, in) -> (B, S / 2, S / 2, out) for an even S.
    [[nodiscard]] Variable operator()(const Variable& x) const;
    /// The memory for one image of side S.
    [[nodiscard]] static LayerMemory memory(std::int64_t in, std::int64_t out, std::int64_t side);

private:
    ConvLayer conv0_;
    ConvLayer conv1_;
    ConvLayer skip_;
};

}  // namespace stymo
