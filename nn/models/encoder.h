#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/io/tensor_file.h"
#include "core/rng.h"
#include "nn/models/codes.h"
#include "nn/parameter_store.h"

namespace stymo {

struct EncoderConfig {
    std::string backbone = "iresnet50";  ///< one of backbone_names()
    std::string backbone_weights{};      ///< a .safetensors file; empty or "random": random weights
    /// Crops the image to the middle 76.5 % of the FFHQ crop, the frame that ArcFace was trained
    /// on.
    bool arcface_crop = false;
    double embedding_scale = 1.0;   ///< factor on the embedding before the heads
    std::int64_t head_width = 512;  ///< heads: embedding -> width -> width / 2 -> code
};

/// Binds the fields under "encoder." .
void describe(ConfigSchema& schema, EncoderConfig& config);

/// A network from an image to an embedding.
class Backbone {
public:
    virtual ~Backbone() = default;
    /// image (B, S, S, 3) in [-1, 1], any S; resized to the network's own input. Returns (B,
    /// embedding_size()).
    [[nodiscard]] virtual Variable operator()(const Variable& image) const = 0;
    /// Whether `activations` is implemented.
    [[nodiscard]] virtual bool has_activations() const { return false; }
    /// Activations of several layers from fine to coarse, (B, h, w, C) each. The image must have a
    /// side of at least 32 pixels and is not resized. Throws ValueError unless `has_activations()`.
    [[nodiscard]] virtual std::vector<Variable> activations(const Variable& image) const;
    [[nodiscard]] virtual std::int64_t embedding_size() const = 0;
    [[nodiscard]] virtual std::int64_t input_side() const = 0;
    /// Number of elements that are kept for the backward pass of one image, measured.
    [[nodiscard]] virtual std::int64_t saved() const = 0;
    /// Sets the weights from a published file, which has the names and the layout of its publisher.
    /// Throws FileError, which names `source` and the first tensor that is missing or has another
    /// shape; ConfigError for a backbone that has no published weights.
    virtual void load_pretrained(const TensorFile& file, const std::string& source) = 0;
};

[[nodiscard]] std::vector<std::string> backbone_names();
/// The value of EncoderConfig::backbone_weights that asks for random weights by name.
inline constexpr const char* random_backbone = "random";
/// Whether the backbone begins with weights from a file.
[[nodiscard]] inline bool is_pretrained(const EncoderConfig& config) {
    return !config.backbone_weights.empty() && config.backbone_weights != random_backbone;
}
/// Whether the backbone has published weights but the configuration neither names a file nor asks
/// for random weights.
[[nodiscard]] bool lacks_backbone_weights(const EncoderConfig& config);
/// Throws ConfigError, which says which file to download, if `lacks_backbone_weights(config)`.
void require_backbone_weights(const EncoderConfig& config);
/// Creates the backbone's parameters under `prefix`, which ends with a dot. Throws ConfigError for
/// an unknown name.
[[nodiscard]] std::unique_ptr<Backbone> make_backbone(const std::string& name,
                                                      ParameterStore& store,
                                                      const std::string& prefix, Rng& rng);

/// The encoder E of the paper: a backbone and four semantic heads. Its parameters are named
/// `prefix`.backbone.* and `prefix`.heads.*.
class Encoder {
public:
    /// Reads `config.backbone_weights` if it names a file. Throws FileError, which names that key,
    /// if the file cannot be used. A caller that will load a trained model's values should clear
    /// the field first.
    Encoder(const EncoderConfig& config, ParameterStore& store, const std::string& prefix,
            Rng& rng);

    /// image (B, S, S, 3) in [-1, 1], the whole unmasked crop -> codes in Z, near 0 at the start.
    [[nodiscard]] Codes operator()(const Variable& image) const;
    [[nodiscard]] const Backbone& backbone() const { return *backbone_; }

private:
    struct Heads;
    bool arcface_crop_;
    std::unique_ptr<Backbone> backbone_;
    std::shared_ptr<Heads> heads_;
    double embedding_scale_;
};

}  // namespace stymo
