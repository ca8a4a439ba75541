#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/autograd/variable.h"
#include "core/config.h"
#include "core/rng.h"
#include "nn/parameter_store.h"
#include "nn/pretrained/perceptual/feature_distance.h"

namespace stymo {

/// The value of LpipsConfig::network that selects the model's own encoder (EncoderDistance).
inline constexpr const char* encoder_network = "encoder";

/// Network and weight files of the learned perceptual distance.
struct LpipsConfig {
    std::string network = "vgg16";  ///< one of lpips_networks(), or encoder_network
    std::string trunk{};  ///< torchvision's weights as .safetensors, with its names and layout;
                          ///< "random": untrained weights
    /// The linear heads (v0.1) as .safetensors, "lin0.model.1.weight" or "vgg.lin0.model.1.weight"
    /// and so on; "random": all ones.
    std::string heads{};

    bool operator==(const LpipsConfig&) const = default;
};

/// "vgg16", "alexnet", "squeezenet1_1"
[[nodiscard]] std::vector<std::string> lpips_networks();
/// The linear heads of LPIPS for this network in a .safetensors file, (1, 1, 1, channels) for each
/// tap. Throws FileError, which names the first one that is missing or has another size.
[[nodiscard]] std::vector<Tensor> read_lpips_heads(const std::filesystem::path& path,
                                                   const std::string& network);
/// Binds "`prefix`network", "`prefix`trunk", "`prefix`heads".
void describe(ConfigSchema& schema, LpipsConfig& config, const std::string& prefix);

/// LPIPS v0.1 (Zhang et al. 2018): the activations of a frozen classification network are
/// normalised over the channels; their squared differences are weighted by linear heads, averaged
/// over the image and summed over the taps.
class Lpips final : public PerceptualDistance {
public:
    /// Reads the weights. Throws ConfigError if a file is not given; the message names the file,
    /// how to import it, and the setting that turns the term off (`off_switch`, for example
    /// "reconstruction.perceptual_weight = 0"). Throws FileError, which names the first tensor that
    /// is missing or has another shape, for an unsuitable file.
    Lpips(const LpipsConfig& config, const std::string& off_switch);
    ~Lpips() override;
    Lpips(Lpips&&) noexcept;
    Lpips& operator=(Lpips&&) noexcept;

    /// `images` have a side of at least smallest_side(). Where all channels are 0, the feature and
    /// the gradient through its norm are 0.
    [[nodiscard]] Features features(const Variable& images) const override;
    /// The smallest side for which the last tap is not empty: 16 for vgg16.
    [[nodiscard]] std::int64_t smallest_side() const;
    [[nodiscard]] LayerMemory memory(std::int64_t side) const override;
    /// The number of weights.
    [[nodiscard]] std::int64_t element_count() const;
    /// One term for each tap, each (B): mean over the pixels of sum_c head_c (a_c - b_c)^2.
    [[nodiscard]] std::vector<Variable> terms(const Features& a, const Features& b) const;
    /// Sum of the terms, (B).
    [[nodiscard]] Variable distance(const Features& a, const Features& b) const;

    /// distance(features(images), target).
    [[nodiscard]] Variable distance_to(const Variable& images,
                                       const Features& target) const override;

    [[nodiscard]] const LpipsConfig& config() const;
    /// Whether any of the weights are random.
    [[nodiscard]] bool random() const;
    /// "vgg16", or "vgg16, random weights".
    [[nodiscard]] std::string label() const override;
    /// Frozen parameters "lpips.trunk. ..." (torchvision's names) and "lpips.heads. ...", for
    /// example to convert them to float64.
    [[nodiscard]] ParameterStore& parameters();

private:
    [[nodiscard]] std::vector<Variable> taps(const Variable& images) const;

    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
