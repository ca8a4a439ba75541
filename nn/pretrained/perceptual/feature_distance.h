#pragma once

#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "nn/layer_memory.h"

namespace stymo {

/// LPIPS adds this to a norm before dividing by it.
inline constexpr double feature_epsilon = 1e-10;

/// Mean over the pixels of sum_c weight_c (unit_channels(x, feature_epsilon)_c - target_c)^2, (B):
/// x and target (B, h, w, C), weight (C). Saves only x and target. With create_graph the gradients
/// are those of the composition. Throws ShapeError for extents that do not match.
[[nodiscard]] Variable feature_distance(const Variable& x, const Tensor& target,
                                        const Tensor& weight);
/// The same as a composition of ops: the reference implementation.
[[nodiscard]] Variable feature_distance_reference(const Variable& x, const Tensor& target,
                                                  const Tensor& weight);

/// A distance between images by the activations of a network, for the perceptual term of the
/// reconstruction loss.
class PerceptualDistance {
public:
    /// Activations, each (B, h, w, C), normalised over the channels.
    using Features = std::vector<Variable>;

    virtual ~PerceptualDistance() = default;

    /// images (B, S, S, 3) in [-1, 1]. Detached features of a target can be kept and reused. Throws
    /// ShapeError for other shapes and for images that are too small.
    [[nodiscard]] virtual Features features(const Variable& images) const = 0;
    /// Distance (B) to a constant target. It makes no normalised copy of the images' activations.
    [[nodiscard]] virtual Variable distance_to(const Variable& images,
                                               const Features& target) const = 0;
    /// Memory for the distance of one image of this side and its gradient.
    [[nodiscard]] virtual LayerMemory memory(std::int64_t side) const = 0;
    /// Name in reports.
    [[nodiscard]] virtual std::string label() const = 0;
};

}  // namespace stymo
