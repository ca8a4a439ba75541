#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "core/tensor.h"
#include "fit/photo/landmarks.h"

namespace stymo {

/// A face in a photo, in pixels of the photo.
struct DetectedFace {
    double left = 0.0;
    double top = 0.0;
    double width = 0.0;
    double height = 0.0;
    Landmarks landmarks;
};

/// How long a face is searched for.
enum class FaceSearch {
    thorough,  ///< as long as it takes to find small and covered faces, too
    quick,     ///< for the images of a film: at their own size, and enlarged to twice that size
};

/// dlib's frontal face detector, and a predictor of 68 landmarks: dlib's or our own.
class FaceDetector {
public:
    /// Whether the library was built with dlib.
    [[nodiscard]] static bool available();

    /// `landmark_model`: a .safetensors file of `stymo-landmarks`, or a file of dlib's
    /// shape_predictor with 68 points; empty for the one of Debian's package libdlib-data, whose
    /// training data exclude commercial use. Throws Error in a build without dlib, FileError if the
    /// file is missing or not such a model.
    explicit FaceDetector(const std::filesystem::path& landmark_model = {});
    ~FaceDetector();
    FaceDetector(FaceDetector&&) noexcept;
    FaceDetector& operator=(FaceDetector&&) noexcept;

    /// The faces of an upright photo (height, width, 3) in [0, 1], largest first. Without haste,
    /// photos are searched at 640 pixels of their longer side, and at more if nothing is found. May
    /// be called from several threads at once.
    [[nodiscard]] std::vector<DetectedFace> find(const Tensor& photo,
                                                 FaceSearch search = FaceSearch::thorough) const;

private:
    struct Implementation;
    std::unique_ptr<const Implementation> implementation_;
};

}  // namespace stymo
