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
    /// A second backbone, which knows faces and is never trained: one of backbone_names() with
    /// published weights, or no_backbone. The head of identity reads its embedding alone (but see
    /// `identity_from_both`), that of texture both.
    std::string identity_backbone = "none";
    std::string identity_weights{};  ///< its published weights, like backbone_weights
    /// The head of identity reads both embeddings too: a backbone that knows faces ignores hair.
    bool identity_from_both = false;
    /// A backbone that is never trained, like the one of identity. The head of expression reads it
    /// alone.
    std::string expression_backbone = "none";
    std::string expression_weights{};
    std::int64_t corrections = 0;  ///< of the heads' codes by a CodeCorrector
    /// Whether the backbone's published weights come with a model or a checkpoint (assume_weights);
    /// no key.
    bool backbone_in_model = false;
};

/// Binds the fields under "encoder." .
void describe(ConfigSchema& schema, EncoderConfig& config);

/// The middle 76.5 % of images (B, S, S, 3) in FFHQ's crop, which is about the frame of ArcFace's
/// training: the same whole number of pixels is cut off every side.
[[nodiscard]] Variable arcface_frame(const Variable& images);
/// Embeddings of unit length, (B, embedding size), of the arcface_frame of images in FFHQ's crop.
[[nodiscard]] Variable face_embedding(const Backbone& identity, const Variable& images);

/// The value of EncoderConfig::backbone_weights that asks for random weights by name.
inline constexpr const char* random_backbone = "random";
/// The value of EncoderConfig's second backbones for an encoder without them.
inline constexpr const char* no_backbone = "none";
/// Whether the backbone begins with weights from a file.
[[nodiscard]] inline bool is_pretrained(const EncoderConfig& config) {
    return config.backbone_in_model ||
           (!config.backbone_weights.empty() && config.backbone_weights != random_backbone);
}
/// The configuration without its files of published weights, for a model whose own file has all
/// weights.
[[nodiscard]] EncoderConfig without_weight_files(EncoderConfig config);
/// Asks for random weights where a file is needed but not named, for a training that begins with a
/// model or a checkpoint.
void assume_weights(EncoderConfig& config);
/// Throws ConfigError, which says which file to download, if a backbone has published weights but
/// the configuration neither names a file nor asks for random weights.
void require_backbone_weights(const EncoderConfig& config);

/// The encoder E of the paper: a backbone and four semantic heads. Its parameters are named
/// `prefix`.backbone.*, `prefix`.identity.*, `prefix`.expression.* (with these backbones) and
/// `prefix`.heads.*.
class Encoder {
public:
    /// Reads the files of weights that `config` names. Throws FileError, which names the key, if a
    /// file cannot be used. A caller that will load a trained model's values passes
    /// `without_weight_files(config)`.
    Encoder(const EncoderConfig& config, ParameterStore& store, const std::string& prefix,
            Rng& rng);

    /// image (B, S, S, 3) in [-1, 1], the whole unmasked crop -> codes in Z, near 0 at the start.
    [[nodiscard]] Codes operator()(const Variable& image) const;
    [[nodiscard]] bool knows_faces() const { return identity_ != nullptr; }
    /// Embeddings by the identity backbone, of unit length. Needs `knows_faces()`.
    [[nodiscard]] Variable face_embedding(const Variable& image) const;
    /// The expression alone, without running a backbone that it is not read from.
    [[nodiscard]] Variable expression(const Variable& image) const;
    [[nodiscard]] const Backbone& backbone() const { return *backbone_; }
    /// Needs `knows_faces()`.
    [[nodiscard]] const Backbone& identity_backbone() const { return *identity_; }

private:
    struct Heads;
    /// Size of what the head of identity reads.
    [[nodiscard]] std::int64_t read_by_identity() const;

    bool arcface_crop_;
    bool identity_from_both_;
    std::unique_ptr<Backbone> backbone_;
    std::unique_ptr<Backbone> identity_;    ///< null without an identity backbone
    std::unique_ptr<Backbone> expression_;  ///< null without an expression backbone
    std::shared_ptr<Heads> heads_;
    double embedding_scale_;
};

}  // namespace stymo
