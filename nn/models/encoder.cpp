#include "nn/models/encoder.h"

#include <array>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/reduce.h"
#include "core/ops/shape_ops.h"
#include "core/work_counts.h"
#include "nn/layers/linear.h"

namespace stymo {
namespace {

void load_backbone(Backbone& backbone, const std::string& path, const char* key) {
    if (path.empty() || path == random_backbone) return;
    if (!std::filesystem::exists(path))
        fail<FileError>(
            key, ": no file ", path,
            "; name an existing file, or set the key to random to train the backbone from scratch");
    try {
        backbone.load_pretrained(read_tensor_file(path), path);
    } catch (const FileError& error) {
        fail<FileError>(key, ": ", error.what());
    }
}

bool lacks_weights(const std::string& backbone, const std::string& file) {
    return backbone != no_backbone && file.empty() && *published_weights(backbone) != '\0';
}

void require_weights(const std::string& backbone, const std::string& file, const char* key,
                     const char* or_else) {
    if (backbone == no_backbone && !file.empty() && file != random_backbone)
        fail<ConfigError>(key, ": there is no such network to read ", file,
                          "; leave the key out, or set the backbone to other than none");
    if (!lacks_weights(backbone, file)) return;
    fail<ConfigError>(key, ": no weights for ", backbone, "; ", published_weights(backbone),
                      ", and name the file", or_else);
}

/// Null for no_backbone.
std::unique_ptr<Backbone> second_backbone(const std::string& name, ParameterStore& store,
                                          const std::string& prefix, Rng& rng) {
    return name == no_backbone ? nullptr : make_backbone(name, store, prefix, rng);
}

constexpr const char* backbone_key = "encoder.backbone_weights";
constexpr const char* identity_key = "encoder.identity_weights";
constexpr const char* expression_key = "encoder.expression_weights";

}  // namespace

Variable arcface_frame(const Variable& images) {
    constexpr double kept = 0.765;
    const std::int64_t side = images.shape(1);
    const std::int64_t margin = std::lround(0.5 * (1.0 - kept) * static_cast<double>(side));
    return slice(slice(images, 1, margin, side - margin), 2, margin, side - margin);
}

Variable face_embedding(const Backbone& identity, const Variable& images) {
    const Variable values = identity(arcface_frame(images));
    return values / sqrt(sum(square(values), {1}) + 1e-12);
}

EncoderConfig without_weight_files(EncoderConfig config) {
    config.backbone_weights.clear();
    config.identity_weights.clear();
    config.expression_weights.clear();
    return config;
}

void assume_weights(EncoderConfig& config) {
    config.backbone_in_model = lacks_weights(config.backbone, config.backbone_weights);
    if (config.backbone_in_model) config.backbone_weights = random_backbone;
    if (lacks_weights(config.identity_backbone, config.identity_weights))
        config.identity_weights = random_backbone;
    if (lacks_weights(config.expression_backbone, config.expression_weights))
        config.expression_weights = random_backbone;
}

void require_backbone_weights(const EncoderConfig& config) {
    require_weights(config.backbone, config.backbone_weights, backbone_key,
                    ", or set it to random to train the backbone from scratch");
    require_weights(config.identity_backbone, config.identity_weights, identity_key, "");
    require_weights(config.expression_backbone, config.expression_weights, expression_key, "");
}

namespace {

/// Embeddings of the length of a vector of ones, so that the heads see values of about 1.
Variable scaled(const Variable& embedding) {
    return embedding / sqrt(mean(square(embedding), {1}) + 1e-12);
}

Variable framed(const Variable& image, bool arcface_crop) {
    return arcface_crop ? arcface_frame(image) : image;
}

std::int64_t size_of(const std::unique_ptr<Backbone>& backbone) {
    return backbone ? backbone->embedding_size() : 0;
}

}  // namespace

/// One semantic head for each group of the code: embedding -> width -> width / 2 -> size of the
/// group.
struct Encoder::Heads {
    struct Head {
        Linear wide;
        Linear narrow;
        Linear code;

        [[nodiscard]] Variable operator()(const Variable& embedding) const {
            return code(narrow(wide(embedding)));
        }
    };
    std::vector<Head> heads;

    /// `inputs`: the sizes of what each head reads.
    Heads(const std::array<std::int64_t, 4>& inputs, std::int64_t width, ParameterStore& store,
          const std::string& prefix, Rng& rng) {
        const LinearOptions hidden{.activation = Activation::leaky_relu};
        // Small last weights: the first codes lie near 0, the mean face of the prior.
        const LinearOptions last{.initial_weight_scale = 0.1};
        for (std::size_t i = 0; i < code_names.size(); ++i) {
            const std::string name = prefix + code_names[i];
            heads.push_back({Linear(store, name + ".wide", inputs[i], width, hidden, rng),
                             Linear(store, name + ".narrow", width, width / 2, hidden, rng),
                             Linear(store, name + ".code", width / 2, code_sizes[i], last, rng)});
        }
    }
};

void describe(ConfigSchema& schema, EncoderConfig& config) {
    schema.choice("encoder.backbone", config.backbone, backbone_names(),
                  "network from the image to an embedding (paper: ArcFace)");
    schema.text("encoder.backbone_weights", config.backbone_weights,
                ".safetensors file with published weights of the backbone (stymo-weights import); "
                "random: trained from scratch, as small_conv and small_residual always are");
    schema.boolean("encoder.arcface_crop", config.arcface_crop,
                   "crop the backbone's input to the frame of ArcFace's training, the middle 76.5 "
                   "% of the FFHQ crop");
    schema.number("encoder.embedding_scale", config.embedding_scale, 1e-3, 1e3,
                  "factor on the embedding before the semantic heads");
    // It is never trained, so one that has no published weights would stay random.
    std::vector<std::string> second{no_backbone};
    for (const std::string& name : backbone_names())
        if (*published_weights(name) != '\0') second.push_back(name);
    schema.choice(
        "encoder.identity_backbone", config.identity_backbone, second,
        "a second backbone that knows faces and is never trained; identity is read from it "
        "alone (but see encoder.identity_from_both), texture from both");
    schema.text("encoder.identity_weights", config.identity_weights,
                ".safetensors file with published weights of the identity backbone");
    schema.boolean("encoder.identity_from_both", config.identity_from_both,
                   "with an identity backbone, identity too is read from both: the backbone that "
                   "knows faces ignores hair");
    schema.choice("encoder.expression_backbone", config.expression_backbone, second,
                  "a backbone that is never trained, from which alone expression is read");
    schema.text("encoder.expression_weights", config.expression_weights,
                ".safetensors file with published weights of the expression backbone");
    schema.integer("encoder.corrections", config.corrections, 0, 16,
                   "times that a photo's codes are rendered, compared with the photo and corrected "
                   "by a learnt step");
    schema.integer("encoder.head_width", config.head_width, 2, 8192,
                   "width of the semantic heads: embedding, width, width / 2, code");
}

Encoder::Encoder(const EncoderConfig& config, ParameterStore& store, const std::string& prefix,
                 Rng& rng)
    : arcface_crop_(config.arcface_crop),
      identity_from_both_(config.identity_from_both),
      backbone_(make_backbone(config.backbone, store, prefix + ".backbone.", rng)),
      identity_(second_backbone(config.identity_backbone, store, prefix + ".identity.", rng)),
      expression_(second_backbone(config.expression_backbone, store, prefix + ".expression.", rng)),
      heads_(std::make_shared<Heads>(
          std::array<std::int64_t, 4>{read_by_identity(),
                                      size_of(expression_ ? expression_ : backbone_),
                                      size_of(backbone_) + size_of(identity_), size_of(backbone_)},
          config.head_width, store, prefix + ".heads.", rng)),
      embedding_scale_(config.embedding_scale) {
    load_backbone(*backbone_, config.backbone_weights, backbone_key);
    if (identity_) load_backbone(*identity_, config.identity_weights, identity_key);
    if (expression_) load_backbone(*expression_, config.expression_weights, expression_key);
}

std::int64_t Encoder::read_by_identity() const {
    if (!identity_) return size_of(backbone_);
    return size_of(identity_) + (identity_from_both_ ? size_of(backbone_) : 0);
}

Codes Encoder::operator()(const Variable& image) const {
    if (image.rank() != 4 || image.shape(1) != image.shape(2) || image.shape(3) != 3)
        fail<ShapeError>("the encoder needs images (batch, side, side, 3), got ", image.shape());
    work::count_named("evaluations", "photos_encoded", image.shape(0));
    const Variable embedding = (*backbone_)(framed(image, arcface_crop_)) * embedding_scale_;
    std::array<Variable, 4> inputs{embedding, embedding, embedding, embedding};
    if (identity_) {
        const Variable face = scaled((*identity_)(arcface_frame(image)));
        inputs[0] = identity_from_both_ ? concat({face, embedding}, 1) : face;
        inputs[2] = concat({embedding, face}, 1);
    }
    Codes codes;
    for (std::size_t i = 0; i < codes.groups.size(); ++i)
        codes.groups[i] = i == 1 && expression_ ? expression(image) : heads_->heads[i](inputs[i]);
    return codes;
}

Variable Encoder::face_embedding(const Variable& image) const {
    return stymo::face_embedding(*identity_, image);
}

Variable Encoder::expression(const Variable& image) const {
    return heads_->heads[1](expression_
                                ? scaled((*expression_)(image))
                                : (*backbone_)(framed(image, arcface_crop_)) * embedding_scale_);
}

}  // namespace stymo
