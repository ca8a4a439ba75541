#pragma once

#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "nn/layer_memory.h"

namespace stymo {

/// A distance of images by the activations of a network: what the perceptual term of the
/// reconstruction loss compares.
class PerceptualDistance {
public:
    /// Activations, each (B, h, w, C), normalised over the channels.
    using Features = std::vector<Variable>;

    virtual ~PerceptualDistance() = default;

    /// images (B, S, S, 3) in [-1, 1]. The features of a target are computed once and kept
    /// (`detach`). Throws ShapeError for other shapes and for images that are too small.
    [[nodiscard]] virtual Features features(const Variable& images) const = 0;
    /// Distance to a target that is a constant, (B), without a normalised copy of the images'
    /// activations.
    [[nodiscard]] virtual Variable distance_to(const Variable& images,
                                               const Features& target) const = 0;
    /// For the distance of one image of this side and its gradient.
    [[nodiscard]] virtual LayerMemory memory(std::int64_t side) const = 0;
    /// Name in reports.
    [[nodiscard]] virtual std::string label() const = 0;
};

}  // namespace stymo
