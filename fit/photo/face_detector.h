#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "core/tensor.h"
#include "fit/photo/landmarks.h"
#include "nn/pretrained/landmark_network.h"

namespace stymo {

/// A face in a photo, in pixels of the photo.
struct DetectedFace {
    double left = 0.0;
    double top = 0.0;
    double width = 0.0;
    double height = 0.0;
    double confidence = 0.0;  ///< about 2 for an upright face, less than 1 for a doubtful one
    Landmarks landmarks;
    FaceCovers covers{};  ///< known to a landmark network of stymo with covers
};

/// Effort of the search for faces.
enum class FaceSearch {
    thorough,  ///< also finds small and partly covered faces
    clear,     ///< the thorough search without its last, doubtful step
    doubtful,  ///< that step alone
    quick,     ///< for video frames: searches only at their own size and at twice that size
};

/// dlib's frontal face detector, and a predictor of 68 landmarks: dlib's or stymo's.
class FaceDetector {
public:
    /// Whether the library was built with dlib.
    [[nodiscard]] static bool available();

    /// `landmark_model`: a .safetensors file of a landmark network, or a file of dlib's
    /// shape_predictor with 68 points. Empty: that of Debian's package libdlib-data, whose training
    /// data exclude commercial use. Throws Error in a build without dlib, FileError if the file is
    /// missing or is not such a model.
    explicit FaceDetector(const std::filesystem::path& landmark_model = {});
    ~FaceDetector();
    FaceDetector(FaceDetector&&) noexcept;
    FaceDetector& operator=(FaceDetector&&) noexcept;

    /// The faces of an upright photo (height, width, 3) in [0, 1], largest first, but last those
    /// with less than a quarter of the clearest one's confidence. A thorough search scales the
    /// photo's longer side to 640 pixels, and to more if it finds nothing. Thread-safe.
    [[nodiscard]] std::vector<DetectedFace> find(const Tensor& photo,
                                                 FaceSearch search = FaceSearch::thorough) const;

    /// The number of clockwise quarter turns, 1 to 3, after which the clearest face of the photo
    /// stands upright; 0 if no turned copy shows one with at least this confidence. Searches copies
    /// with a longer side of at most 640 pixels. Thread-safe.
    [[nodiscard]] int turns_to_face(const Tensor& photo, double confidence) const;

private:
    struct Implementation;
    std::unique_ptr<const Implementation> implementation_;
};

}  // namespace stymo
