#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "core/config.h"
#include "core/rng.h"
#include "nn/layer_memory.h"
#include "nn/parameter_store.h"

namespace stymo {

/// Network and weight files of the learned perceptual distance.
struct LpipsConfig {
    std::string network = "vgg16";  ///< one of lpips_networks()
    std::string trunk{};  ///< torchvision's weights as .safetensors, in its names and layout;
                          ///< "random": untrained ones
    /// The linear heads (v0.1) as .safetensors, "lin0.model.1.weight" or "vgg.lin0.model.1.weight"
    /// and so on; "random": all ones.
    std::string heads{};

    bool operator==(const LpipsConfig&) const = default;
};

/// "vgg16", "alexnet", "squeezenet1_1"
[[nodiscard]] std::vector<std::string> lpips_networks();
/// Binds "`prefix`network", "`prefix`trunk", "`prefix`heads".
void describe(ConfigSchema& schema, LpipsConfig& config, const std::string& prefix);

/// LPIPS v0.1 (Zhang et al. 2018): channel-normalised activations of a frozen classification
/// network, squared differences weighted by linear heads, mean over the image, sum over the taps.
class Lpips {
public:
    /// Activations at the taps, each (B, h, w, C), normalised over the channels.
    using Features = std::vector<Variable>;

    /// Reads the weights. Throws ConfigError if a file is not given; the message names the file,
    /// how to import it, and the setting that turns the term off (`off_switch`, for example
    /// "reconstruction.perceptual_weight = 0"). Throws FileError for an unsuitable file, naming the
    /// first tensor that is missing or of another shape.
    Lpips(const LpipsConfig& config, const std::string& off_switch);
    ~Lpips();
    Lpips(Lpips&&) noexcept;
    Lpips& operator=(Lpips&&) noexcept;

    /// images (B, S, S, 3) in [-1, 1], S at least smallest_side(). The features of a target are
    /// computed once and kept (`detach`). Where all channels are 0, the feature and the gradient
    /// through its norm are 0 too. Throws ShapeError for other shapes.
    [[nodiscard]] Features features(const Variable& images) const;
    /// Side of the smallest image that reaches the last tap: 16 for vgg16.
    [[nodiscard]] std::int64_t smallest_side() const;
    /// For the distance of one image of this side and its gradient.
    [[nodiscard]] LayerMemory memory(std::int64_t side) const;
    /// The number of weights.
    [[nodiscard]] std::int64_t element_count() const;
    /// One term for each tap, each (B): mean over the pixels of sum_c head_c (a_c - b_c)^2.
    [[nodiscard]] std::vector<Variable> terms(const Features& a, const Features& b) const;
    /// Sum of the terms, (B).
    [[nodiscard]] Variable distance(const Features& a, const Features& b) const;

    /// distance(features(images), target) for a target that is a constant, without a normalised
    /// copy of the images' activations.
    [[nodiscard]] Variable distance_to(const Variable& images, const Features& target) const;

    [[nodiscard]] const LpipsConfig& config() const;
    /// Whether any of the weights are random.
    [[nodiscard]] bool random() const;
    /// Name in reports: "vgg16", or "vgg16, random weights".
    [[nodiscard]] std::string label() const;
    /// Frozen parameters "lpips.trunk. ..." (torchvision's names) and "lpips.heads. ...", to
    /// convert to float64 or compare with.
    [[nodiscard]] ParameterStore& parameters();

private:
    [[nodiscard]] std::vector<Variable> taps(const Variable& images) const;

    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
