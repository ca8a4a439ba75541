#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "nn/engine/packed_layer.h"
#include "nn/layers/mask_branch.h"
#include "nn/layers/render_block.h"

namespace stymo {

/// The weights of a folded render block and of its lateral layer of the mask branch, in the memory
/// layout of the renderer.
struct PackedBlock {
    /// Output k * channels + c is channel c of sub-pixel k = 2 row + column.
    PackedLayer<float> detail;
    PackedLayer<float> modulated0;
    PackedLayer<float> modulated1;
    std::vector<float> rgb_weight;  ///< (3, out)
    std::vector<float> rgb_bias;
    PackedLayer<float> lateral;  ///< empty without a mask

    MatmulPrecision precision;  ///< of all layers but those of RGB

    PackedBlock(const FoldedRenderBlock& block, const FoldedLayer* mask_lateral,
                MatmulPrecision precision_of_layers);
    /// Replaces the modulated layers by those of `block`.
    void set_style(const FoldedRenderBlock& block);

    [[nodiscard]] std::int64_t in() const { return modulated0.inputs(); }
    [[nodiscard]] std::int64_t out() const { return modulated1.outputs(); }
};

}  // namespace stymo
