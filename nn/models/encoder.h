#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/rng.h"
#include "nn/models/codes.h"
#include "nn/parameter_store.h"
#include "nn/pretrained/backbones/backbone.h"

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

/// The value of EncoderConfig::backbone_weights that asks for random weights by name.
/// The middle 76.5 % of images (B, S, S, 3) in FFHQ's crop, which is about the frame of ArcFace's
/// training: the same whole number of pixels is cut off every side.
[[nodiscard]] Variable arcface_frame(const Variable& images);

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
