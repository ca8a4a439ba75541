#include "nn/engine/packed_block.h"

#include <algorithm>
#include <span>

namespace stymo {
namespace {

/// Channel c of sub-pixel k is the detail's output 4 c + k. With the channels of a sub-pixel side
/// by side nothing has to be shuffled afterwards.
FoldedLayer ordered_by_subpixel(const FoldedLayer& detail) {
    const std::int64_t channels = detail.weight.shape(1);
    FoldedLayer ordered{Tensor(detail.weight.shape()), Tensor(detail.bias.shape()),
                        detail.activation};
    const std::span<const float> weight = detail.weight.values<float>(),
                                 bias = detail.bias.values<float>();
    const std::span<float> to_weight = ordered.weight.mutable_values<float>(),
                           to_bias = ordered.bias.mutable_values<float>();
    for (std::int64_t c = 0; c < channels; ++c) {
        for (std::int64_t k = 0; k < 4; ++k) {
            const std::int64_t from = 4 * c + k, to = k * channels + c;
            std::copy_n(weight.data() + from * channels, channels,
                        to_weight.data() + to * channels);
            to_bias[static_cast<std::size_t>(to)] = bias[static_cast<std::size_t>(from)];
        }
    }
    return ordered;
}

}  // namespace

PackedBlock::PackedBlock(const FoldedRenderBlock& block, const FoldedLayer* mask_lateral,
                         MatmulPrecision precision_of_layers)
    : detail(ordered_by_subpixel(block.detail), precision_of_layers),
      rgb_weight(values_of<float>(block.to_rgb.weight)),
      rgb_bias(values_of<float>(block.to_rgb.bias)),
      precision(precision_of_layers) {
    if (mask_lateral != nullptr) lateral = PackedLayer<float>(*mask_lateral, precision);
    set_style(block);
}

void PackedBlock::set_style(const FoldedRenderBlock& block) {
    modulated0 = PackedLayer<float>(block.modulated0, precision);
    modulated1 = PackedLayer<float>(block.modulated1, precision);
}

}  // namespace stymo
