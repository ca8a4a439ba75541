#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "nn/models/code_statistics.h"
#include "nn/models/decoder.h"
#include "nn/models/encoder.h"
#include "nn/models/perceptual/lpips.h"

namespace stymo {

/// Where the camera of a face stands: shared intrinsics and the place that it looks at.
struct CameraConfig {
    Intrinsics intrinsics;
    double distance = 5.3;     ///< from the head's origin to the camera of a frontal view
    double pivot_depth = 0.9;  ///< z of the point on the face that stays in the middle of the image
                               ///< as the head turns
};

/// What reconstruction means for this model, in training and in fitting alike.
struct ReconstructionConfig {
    std::vector<double> resolution_weights{0.01, 0.1, 0.5, 1.0};  ///< gamma of 64, 128, 256, 512
    double photometric_weight = 1.0;
    double perceptual_weight = 0.1;  ///< lambda of LPIPS at the largest resolution
    LpipsConfig perceptual;
    /// Side of the images that LPIPS compares at most, a power of two; larger ones are reduced to
    /// it by means. 0: no limit.
    std::int64_t perceptual_resolution = 0;
    std::int64_t fit_samples_per_ray = 64;
    double fit_regularizer = 1.0;     ///< weight of the sum of squared code offsets
    double fit_learning_rate = 0.01;  ///< of a fit's first step
};

struct ModelConfig {
    DecoderConfig decoder;
    EncoderConfig encoder;
    /// Where the code of a photo comes from: "encoder"; "morphable", the data's fit of a morphable
    /// model; "morphable_offset", the same plus an offset that training learns for each of its
    /// photos.
    std::string code_source = "encoder";
    CameraConfig camera;
    ReconstructionConfig reconstruction;
};

/// Binds "decoder.", "encoder.", "codes.", "camera.", "reconstruction." .
void describe(ConfigSchema& schema, ModelConfig& config);

/// What is made of a model.
enum class ModelParts {
    all,
    decoder,  ///< for codes that are known already; of the encoder nothing is made
};

/// Encoder, unless codes come from elsewhere, and decoder with their parameters: what is trained,
/// saved, fitted and rendered. Parameters are named "encoder. ..." and "decoder. ...".
class Model {
public:
    /// Random weights from `rng`, but the encoder's backbone from its weights file if the
    /// configuration names one.
    Model(const ModelConfig& config, Rng& rng);

    /// A trained model, frozen. Throws FileError for a file that is missing, malformed or not a
    /// model of stymo.
    [[nodiscard]] static Model load(const std::filesystem::path& path,
                                    ModelParts parts = ModelParts::all);
    /// Writes every parameter, the configuration (metadata "config") and the statistics of codes,
    /// if any. Whole or not at all. Throws ValueError for a part.
    void save(const std::filesystem::path& path) const;

    [[nodiscard]] const ModelConfig& config() const { return config_; }
    [[nodiscard]] ParameterStore& parameters() { return parameters_; }
    [[nodiscard]] const ParameterStore& parameters() const { return parameters_; }
    /// Throws ValueError for a model without one, and where only the decoder was loaded.
    [[nodiscard]] const Encoder& encoder() const;
    [[nodiscard]] bool has_encoder() const { return encoder_.has_value(); }
    [[nodiscard]] const Decoder& decoder() const { return decoder_; }
    /// Of the codes of faces that it was trained on, if its file has them: the end of a training
    /// adds them.
    [[nodiscard]] const std::optional<CodeStatistics>& code_statistics() const {
        return code_statistics_;
    }

private:
    Model(const ModelConfig& config, Rng& rng, ModelParts parts, ParameterStore parameters);

    ModelConfig config_;
    ParameterStore parameters_;
    std::optional<Encoder> encoder_;
    Decoder decoder_;
    std::optional<CodeStatistics> code_statistics_;
};

/// The model's configuration as it stands in the metadata of its file.
[[nodiscard]] std::string to_json(const ModelConfig& config);

}  // namespace stymo
