#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "nn/models/code_corrector.h"
#include "nn/models/code_statistics.h"
#include "nn/models/decoder.h"
#include "nn/models/encoder.h"
#include "nn/pretrained/perceptual/lpips.h"

namespace stymo {

/// Intrinsics and placement of the camera, shared by all faces.
struct CameraConfig {
    Intrinsics intrinsics;
    double distance = 5.3;  ///< from the head's origin to the camera of a frontal view
    /// World z of the point that stays in the middle of the image as the head turns.
    double pivot_depth = 0.9;
};

/// The camera with these intrinsics. A focal length that differs moves it to where the point at
/// `pivot_depth` keeps its size in the image.
[[nodiscard]] CameraConfig with_intrinsics(CameraConfig camera, const Intrinsics& intrinsics);

/// The reconstruction loss of this model, for training and for fitting.
struct ReconstructionConfig {
    /// gamma of the paper for the sides 64, 128, 256, 512.
    std::vector<double> resolution_weights{0.01, 0.1, 0.5, 1.0};
    double photometric_weight = 1.0;
    double perceptual_weight = 0.1;  ///< lambda of LPIPS at the largest resolution
    LpipsConfig perceptual;
    /// Largest side of the images that LPIPS compares, a power of two. Larger images are reduced to
    /// it by a box filter. 0: no limit.
    std::int64_t perceptual_resolution = 0;
    std::int64_t fit_samples_per_ray = 64;
    double fit_regularizer = 1.0;     ///< weight of the sum of squared code offsets
    double fit_learning_rate = 0.01;  ///< of the first step of a fit
};

struct ModelConfig {
    DecoderConfig decoder;
    EncoderConfig encoder;
    /// Where the code of a photo comes from. "encoder": the encoder. "morphable": the data set,
    /// which has a fit of a morphable model. With "_offset" after either, training
    /// learns an offset of the code of each training photo.
    std::string code_source = "encoder";
    CameraConfig camera;
    ReconstructionConfig reconstruction;
};

/// Whether the codes of photos come from an encoder.
[[nodiscard]] bool uses_encoder(const ModelConfig& config);
/// Whether training learns offsets of the codes of its photos.
[[nodiscard]] bool learns_codes(const ModelConfig& config);

/// Binds "decoder.", "encoder.", "codes.", "camera.", "reconstruction." .
void describe(ConfigSchema& schema, ModelConfig& config);

/// The parts of a model that are created.
enum class ModelParts {
    all,
    decoder,  ///< without the encoder, for codes that are already known
};

/// A decoder, an encoder unless codes come from elsewhere, and their parameters. Parameters are
/// named "encoder.*" and "decoder.*".
class Model {
public:
    /// Random weights from `rng`. The encoder's backbone is read from a weights file if the
    /// configuration names one.
    Model(const ModelConfig& config, Rng& rng);

    /// Reads a trained model and freezes its parameters. Throws FileError for a file that is
    /// missing, malformed or not a model of stymo.
    [[nodiscard]] static Model load(const std::filesystem::path& path,
                                    ModelParts parts = ModelParts::all);
    /// Writes every parameter, the configuration (metadata "config") and the code statistics, if
    /// any; completely or not at all. Throws ValueError if only the decoder was loaded.
    void save(const std::filesystem::path& path) const;

    /// A frozen model with the same values, for example to change them. Throws ValueError for
    /// ModelParts::all if only the decoder was loaded.
    [[nodiscard]] Model copy(ModelParts parts = ModelParts::all) const;

    [[nodiscard]] const ModelConfig& config() const { return config_; }
    [[nodiscard]] ParameterStore& parameters() { return parameters_; }
    [[nodiscard]] const ParameterStore& parameters() const { return parameters_; }
    /// Throws ValueError for a model without an encoder, and if only the decoder was loaded.
    [[nodiscard]] const Encoder& encoder() const;
    /// Null without encoder.corrections.
    [[nodiscard]] const CodeCorrector* corrector() const {
        return corrector_ ? &*corrector_ : nullptr;
    }
    [[nodiscard]] bool has_encoder() const { return encoder_.has_value(); }
    [[nodiscard]] const Decoder& decoder() const { return decoder_; }
    /// Statistics of the codes of the training faces, if the model's file has them. They are added
    /// at the end of a training.
    [[nodiscard]] const std::optional<CodeStatistics>& code_statistics() const {
        return code_statistics_;
    }
    /// The mean PSNR in dB of its first guesses of the validation photos of its training, if known.
    [[nodiscard]] std::optional<double> validation_psnr() const { return validation_psnr_; }
    void set_validation_psnr(double psnr) { validation_psnr_ = psnr; }

private:
    Model(const ModelConfig& config, Rng& rng, ModelParts parts, ParameterStore parameters);

    ModelConfig config_;
    ParameterStore parameters_;
    std::optional<Encoder> encoder_;
    std::optional<CodeCorrector> corrector_;
    Decoder decoder_;
    std::optional<CodeStatistics> code_statistics_;
    std::optional<double> validation_psnr_;
};

/// The configuration in the form that the metadata of a model's file has, under this key.
inline constexpr const char* config_key = "config";
[[nodiscard]] std::string to_json(const ModelConfig& config);

}  // namespace stymo
