#include "nn/models/model.h"

#include <charconv>
#include <cmath>

#include "core/error.h"
#include "core/exact_text.h"
#include "core/io/tensor_file.h"

namespace stymo {

namespace {

constexpr const char* model_format_key = "format";
constexpr const char* model_format = "stymo-model-1";
constexpr const char* psnr_key = "validation_psnr";

}  // namespace

CameraConfig with_intrinsics(CameraConfig camera, const Intrinsics& intrinsics) {
    if (intrinsics.focal != camera.intrinsics.focal)
        camera.distance = camera.pivot_depth + (camera.distance - camera.pivot_depth) *
                                                   intrinsics.focal / camera.intrinsics.focal;
    camera.intrinsics = intrinsics;
    return camera;
}

void describe(ConfigSchema& schema, ModelConfig& config) {
    describe(schema, config.decoder);
    describe(schema, config.encoder);
    schema.choice(
        "codes.source", config.code_source,
        {"encoder", "encoder_offset", "morphable", "morphable_offset"},
        "source of a photo's code: the encoder (paper), the data set's code of a morphable model, "
        "or either one with an offset learnt per training photo (HeadNeRF)");
    CameraConfig& camera = config.camera;
    schema.number("camera.focal", camera.intrinsics.focal, 0.1, 100.0,
                  "focal length in units of the image side, shared by all images");
    schema.number("camera.center_x", camera.intrinsics.center_x, -1.0, 2.0,
                  "principal point in units of the image side");
    schema.number("camera.center_y", camera.intrinsics.center_y, -1.0, 2.0,
                  "principal point in units of the image side");
    schema.number("camera.distance", camera.distance, 0.1, 1000.0,
                  "distance of the frontal camera from the head's origin, in decimetres");
    schema.number("camera.pivot_depth", camera.pivot_depth, -10.0, 10.0,
                  "z of the point that stays in the middle of the image when the head turns");
    ReconstructionConfig& reconstruction = config.reconstruction;
    schema.numbers("reconstruction.resolution_weights", reconstruction.resolution_weights, 0.0, 1e6,
                   "gamma of the L1 term at 64, 128, 256, 512 (paper: 0.01, 0.1, 0.5, 1)");
    schema.number("reconstruction.photometric_weight", reconstruction.photometric_weight, 0.0, 1e6,
                  "lambda of the photometric loss (paper: 1)");
    schema.number("reconstruction.perceptual_weight", reconstruction.perceptual_weight, 0.0, 1e6,
                  "lambda of LPIPS at the largest resolution (paper: 0.1); 0: no LPIPS");
    describe(schema, reconstruction.perceptual, "reconstruction.perceptual_");
    schema.integer("reconstruction.perceptual_resolution", reconstruction.perceptual_resolution, 0,
                   4096, "largest side that LPIPS compares, a power of two; 0: no limit (paper)");
    schema.integer("reconstruction.fit_samples_per_ray", reconstruction.fit_samples_per_ray, 2,
                   4096, "samples per ray while fitting (paper: 64)");
    schema.number("reconstruction.fit_regularizer", reconstruction.fit_regularizer, 0.0, 1e6,
                  "weight of the squared code offsets while fitting (paper: 1, which keeps the "
                  "offsets near zero)");
    schema.number("reconstruction.fit_learning_rate", reconstruction.fit_learning_rate, 1e-6, 10.0,
                  "learning rate of a fit's first step (paper: 0.01)");
}

bool uses_encoder(const ModelConfig& config) {
    return config.code_source.starts_with("encoder");
}

bool learns_codes(const ModelConfig& config) {
    return config.code_source.ends_with("_offset");
}

std::string to_json(const ModelConfig& config) {
    ModelConfig copy = config;
    ConfigSchema schema;
    describe(schema, copy);
    return schema.to_json();
}

Model::Model(const ModelConfig& config, Rng& rng) : Model(config, rng, ModelParts::all, {}) {}

Model::Model(const ModelConfig& config, Rng& rng, ModelParts parts, ParameterStore parameters)
    : config_(config),
      parameters_(std::move(parameters)),
      encoder_(
          parts == ModelParts::all && uses_encoder(config)
              ? std::optional<Encoder>(std::in_place, config.encoder, parameters_, "encoder", rng)
              : std::nullopt),
      corrector_(encoder_ && config.encoder.corrections > 0
                     ? std::optional<CodeCorrector>(std::in_place, parameters_, "encoder.corrector",
                                                    encoder_->knows_faces() ? 2 : 1, rng)
                     : std::nullopt),
      decoder_(config.decoder, parameters_, "decoder", rng) {}

const Encoder& Model::encoder() const {
    if (!encoder_ && !uses_encoder(config_))
        fail<ValueError>(
            "this model has no encoder: its codes are those of a morphable model, which a photo "
            "must bring along "
            "(codes.source = ",
            config_.code_source, ")");
    if (!encoder_) fail<ValueError>("of this model only the decoder was loaded");
    return *encoder_;
}

Model Model::load(const std::filesystem::path& path, ModelParts parts) {
    const TensorFile file = read_tensor_file(path);
    const auto format = file.metadata.find(model_format_key);
    const auto text = file.metadata.find(config_key);
    if (format == file.metadata.end() || format->second != model_format ||
        text == file.metadata.end()) {
        fail<FileError>(path.string(), R"(: not a model of stymo (its metadata lack "format": ")",
                        model_format, R"(" or "config"))");
    }
    ModelConfig config;
    ConfigSchema schema;
    describe(schema, config);
    schema.read_text(text->second, path.string());
    config.encoder = without_weight_files(config.encoder);
    Rng unused(0);
    Model model(config, unused, parts, {file, path.string()});
    model.parameters_.load(file, path.string());
    model.parameters_.set_trainable("", false);
    model.code_statistics_ = CodeStatistics::load(file, path.string());
    if (const auto psnr = file.metadata.find(psnr_key); psnr != file.metadata.end()) {
        const std::string& number = psnr->second;
        double value = 0.0;
        const auto end = std::from_chars(number.data(), number.data() + number.size(), value);
        if (end == std::from_chars_result{number.data() + number.size(), std::errc()} &&
            std::isfinite(value))
            model.validation_psnr_ = value;
    }
    return model;
}

Model Model::copy(ModelParts parts) const {
    if (parts == ModelParts::all && uses_encoder(config_)) static_cast<void>(encoder());
    TensorFile values;
    parameters_.save(values);
    ModelConfig config = config_;
    config.encoder = without_weight_files(config.encoder);
    Rng unused(0);
    Model model(config, unused, parts, {values, "a copy of a model"});
    model.config_ = config_;
    model.parameters_.convert(parameters_.all().front().variable().dtype());
    model.parameters_.load(values, "a copy of a model");
    model.parameters_.set_trainable("", false);
    model.code_statistics_ = code_statistics_;
    model.validation_psnr_ = validation_psnr_;
    return model;
}

void Model::save(const std::filesystem::path& path) const {
    if (!has_encoder() && uses_encoder(config_))
        fail<ValueError>(path.string(), ": a model without its encoder is not saved");
    TensorFile file;
    file.metadata[model_format_key] = model_format;
    file.metadata[config_key] = to_json(config_);
    if (validation_psnr_) file.metadata[psnr_key] = exact_text(*validation_psnr_);
    parameters_.save(file);
    if (code_statistics_) code_statistics_->save(file);
    write_tensor_file(path, file);
}

}  // namespace stymo
