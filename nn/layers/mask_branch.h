#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "nn/layer_memory.h"
#include "nn/layers/linear.h"

namespace stymo {

struct FoldedMaskBranch {
    std::vector<FoldedLayer> laterals;  ///< one for each render block, from coarse to fine
    FoldedLayer logit;
};

/// Head mask from the features of all render blocks (the paper's SegLite, whose architecture is not
/// published). A 1x1 layer with leaky ReLU (slope 0.2, no gain) reduces the features of each block
/// to a few channels. They are summed from coarse to fine with bilinear upsampling, and a linear
/// layer gives one logit.
class MaskBranch {
public:
    /// `channels` and `names` are those of the render blocks. Creates `prefix`.lateral<name> and
    /// `prefix`.logit.
    MaskBranch(ParameterStore& store, const std::string& prefix,
               std::span<const std::int64_t> channels, std::span<const std::string> names,
               std::int64_t mask_channels, Rng& rng);

    /// Features of the first blocks in ascending order, each (B, S, S, channels) with twice the
    /// side of the one before -> logit (B, S, S, 1) at the side of the last. Throws ShapeError for
    /// no features or for more than there are blocks.
    [[nodiscard]] Variable operator()(std::span<const Variable> features) const;
    [[nodiscard]] FoldedMaskBranch folded() const;
    /// Memory for feature maps of these sides, in ascending order. `recomputed`: the backward pass
    /// computes the branch again.
    [[nodiscard]] LayerMemory memory(std::span<const std::int64_t> sides, std::int64_t images,
                                     bool recomputed) const;

private:
    std::vector<Linear> laterals_;
    Linear logit_;
};

}  // namespace stymo
