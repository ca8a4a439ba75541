#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/rng.h"
#include "nn/layers/conv_layer.h"
#include "nn/layers/linear.h"
#include "nn/parameter_store.h"
#include "nn/pretrained/face_square.h"

namespace stymo {

/// What a landmark network sees of a face: strided 3x3 convolutions with residual pairs, from 80 x
/// 80 to 5 x 5 pixels, and a linear layer.
class LandmarkFeatures {
public:
    static constexpr std::int64_t input_side = 80;
    static constexpr std::int64_t count = 192;

    /// Creates the parameters under `prefix`, which ends with a dot.
    LandmarkFeatures(ParameterStore& store, const std::string& prefix, Rng& rng);

    /// Images (B, 80, 80, 3) in [0, 1] of squares (`square_around`) -> (B, count). The result does
    /// not depend on the contrast and brightness of an image.
    [[nodiscard]] Variable operator()(const Variable& images) const {
        return hidden(last_layer(images));
    }
    static constexpr std::int64_t last_layer_count = 3200;
    /// The last convolutions' results, (B, last_layer_count).
    [[nodiscard]] Variable last_layer(const Variable& images) const;
    /// The features from these.
    [[nodiscard]] Variable hidden(const Variable& last_layer) const { return hidden_(last_layer); }

private:
    struct Level {
        ConvLayer down;
        std::vector<ConvLayer> pair;
    };
    static std::vector<Level> make_levels(ParameterStore& store, const std::string& prefix,
                                          Rng& rng);

    std::vector<Level> levels_;
    Linear hidden_;
};

/// A network that finds the 68 landmarks of a face: LandmarkFeatures and a linear layer. 1.3
/// million parameters, 53 million multiply-adds.
class LandmarkNetwork {
public:
    static constexpr std::int64_t input_side = LandmarkFeatures::input_side;

    /// Creates the parameters under `prefix`, which ends with a dot.
    LandmarkNetwork(ParameterStore& store, const std::string& prefix, Rng& rng);

    /// Images as for LandmarkFeatures -> (B, 136): x and y of each point in coordinates of the
    /// square, in which it spans [-1, 1], y downwards.
    [[nodiscard]] Variable operator()(const Variable& images) const {
        return points(features(images));
    }
    static constexpr std::int64_t feature_count = LandmarkFeatures::last_layer_count;
    /// What covers and points are computed from, LandmarkFeatures::last_layer.
    [[nodiscard]] Variable features(const Variable& images) const {
        return features_.last_layer(images);
    }
    /// The coordinates from the features.
    [[nodiscard]] Variable points(const Variable& features) const {
        return points_(features_.hidden(features));
    }

private:
    LandmarkFeatures features_;
    Linear points_;
};

/// Log odds that something (a hand, a mask, sunglasses) covers a face; 0 if that is not known.
struct FaceCovers {
    double mouth = 0.0;
    double eyes = 0.0;  ///< one of them or both
};

/// A landmark network with its weights. Copies share them.
struct LandmarkModel {
    std::shared_ptr<ParameterStore> store;
    LandmarkNetwork network;
    /// (2, 3200) and (2): FaceCovers as linear functions of the features; undefined without them.
    Tensor cover_weight{}, cover_bias{};
};

/// A model with random weights.
[[nodiscard]] LandmarkModel make_landmark_model(Rng rng);
/// Throws FileError for a file that was not written by `write_landmark_model`. The file
/// covers.safetensors beside it, written by scripts/train_covers.py, is read if it is there.
[[nodiscard]] LandmarkModel read_landmark_model(const std::filesystem::path& path);
/// Writes a .safetensors file, whole or not at all.
void write_landmark_model(const std::filesystem::path& path, const LandmarkModel& model);

/// Landmarks in pixels of a photo (height, width, 3) in [0, 1]: the mean of the network's results
/// for several squares and their mirror images.
[[nodiscard]] FacePoints points_in_squares(const LandmarkModel& model, const Tensor& photo,
                                           const std::vector<FaceSquare>& squares);
/// Landmarks of the face near `start`, in pixels of the photo. Each result of the network gives the
/// square for the next evaluation. Throws NumericError if a result has both eyes at the same point.
/// `covers`, if given, is set to the mean over the last squares.
[[nodiscard]] FacePoints find_points(const LandmarkModel& model, const Tensor& photo,
                                     const FaceSquare& start, FaceCovers* covers = nullptr);

}  // namespace stymo
