#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "apps/drive/film_report.h"
#include "core/tensor.h"
#include "fit/photo/face_detector.h"
#include "fit/video/film_follower.h"
#include "nn/models/code_file.h"
#include "nn/models/identity_network.h"
#include "nn/models/model.h"
#include "nn/realtime/chosen_tolerance.h"

namespace stymo {

struct DrivenFaceOptions {
    std::int64_t size = 0;  ///< side of the images; 0: the model's resolution
    bool absolute = false;  ///< expressions replace the face's own; else they are added to it
    bool measure = false;   ///< compares the landmarks of frames and images
    double psnr = 45.0;     ///< decibels of the face at rest against exact images
    std::filesystem::path identity{};  ///< weights for IdentityNetwork, or none
};

/// A change of no expression, (1, 79).
[[nodiscard]] Tensor unmoved();

/// Renders a face with the expression and the pose of each frame of a film.
class DrivenFace {
public:
    /// What is measured of the images.
    struct Measures {
        LandmarkJitter film, driven;
        double least_cosine = 1.0, cosines = 0.0;  ///< to the face at rest
        std::int64_t compared = 0;
    };

    /// `model` must outlive this object, as `detector`, which may be null unless `options.measure`
    /// is set. Throws what `choose_renderer` and IdentityNetwork throw.
    DrivenFace(DrivenFaceOptions options, const Model& model, CodeFile face,
               const FaceDetector* detector);

    /// How exact the images of the face at rest are.
    [[nodiscard]] const ChosenRenderer& renderer() const { return chosen_; }
    /// The image for the next frame; the last one where the film shows no face.
    [[nodiscard]] Tensor frame(const FilmFrame& seen);
    [[nodiscard]] const Measures& measures() const { return measures_; }

private:
    [[nodiscard]] Tensor rendered(const Codes& codes, double yaw, double pitch, double roll);
    /// Of the face that was shown last.
    [[nodiscard]] std::vector<double> embedding_from(double yaw, double pitch, double roll);
    void measure(const FilmFrame& seen);

    DrivenFaceOptions options_;
    const Model& model_;
    const FaceDetector* detector_;
    CodeFile face_;
    Variable neutral_;  ///< (1, 79), the mean over the model's faces; without statistics 0
    ChosenRenderer chosen_;
    std::optional<IdentityNetwork> identity_;
    std::vector<double> embedding_;  ///< of the face at rest
    Tensor last_;
    Measures measures_;
};

}  // namespace stymo
