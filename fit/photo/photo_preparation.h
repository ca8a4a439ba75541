#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/io/image.h"
#include "core/tensor.h"
#include "fit/morphable/morphable_fit.h"
#include "fit/photo/landmarks.h"
#include "fit/photo/network_poses.h"
#include "nn/models/model.h"
#include "render/camera.h"
#include "render/morphable/head.h"

namespace stymo {

struct PhotoPreparationSettings {
    std::int64_t side = 256;       ///< of images and masks made, in pixels
    std::int64_t wanted_side = 0;  ///< side in pixels below which a crop gets a warning; 0: `side`
    Intrinsics intrinsics;         ///< that the poses are found for
    std::int64_t most_pixels = usual_most_pixels;  ///< photos with more are refused
    bool all_faces = false;                        ///< of a photo with several; else the largest
    bool new_masks = false;  ///< masks are made even where one is known, and both are compared
    PivotCamera pivot;       ///< of poses from a network
    /// Its heads guide GrabCut where there is no face parser (model_mask.h); must outlive the
    /// preparation. Null: GrabCut goes by the landmarks.
    const Model* mask_model = nullptr;
    // Optional files; an empty path means that the file is not used.
    std::filesystem::path landmark_model;  ///< in place of libdlib-data's (FaceDetector)
    std::filesystem::path parser;          ///< ONNX of a face parser; GrabCut without one
    std::filesystem::path pose_network;  ///< ONNX of a network whose rotations are found beside the
                                         ///< morphable fit's pose
    std::filesystem::path
        morphable;  ///< head to fit (morphable_head_from); the built-in one without
};

/// Mask and landmarks of a photo that are known beforehand, in its own frame.
struct KnownOfPhoto {
    Tensor mask;  ///< (height, width, 1), of any size of the photo's proportions; may be undefined
    std::optional<Landmarks> landmarks;  ///< in pixels of the photo: no face is searched for
};

/// One face cut out of a photo as FFHQ does, or the photo itself if it was aligned already.
struct FaceCrop {
    Tensor image;         ///< (side, side, 3) in [0, 1]
    Tensor mask;          ///< (side, side, 1) in [0, 1], 1 on the head
    Landmarks landmarks;  ///< in pixels of `image`
    bool was_aligned = false;
    bool made_mask = false;  ///< whether the mask was made here
    Tensor known_mask;       ///< (512, 512, 1) where the mask was made in its place, until `finish`
    std::optional<double> mask_agreement;  ///< intersection over union of both, after `finish`
    std::int64_t faces = 1;                ///< found in the photo
    double side_in_photo = 0.0;            ///< in pixels of the photo
    double share_outside = 0.0;            ///< of the crop, beyond the photo's edges
    MorphableFitTarget fit_target;         ///< the same at the resolution of the morphable fit
    Tensor face_box;                       ///< for the pose network, if there is one
};

/// A face with pose and codes.
struct PreparedFace {
    FaceCrop crop;
    MorphableFit fit;
    std::optional<Eigen::Matrix3d> network_rotation;
    std::vector<std::string> warnings;
    std::string failure;  ///< why it cannot be used; empty if it can
};

/// Turns unprepared photos into faces in FFHQ's frame with masks, poses and codes: landmarks by
/// dlib, alignment, mask by a face parser or GrabCut, morphable fit, pose network.
class PhotoPreparation {
public:
    /// Reads the networks and the head. Throws FileError for a file that is missing or of another
    /// kind.
    explicit PhotoPreparation(const PhotoPreparationSettings& settings);
    ~PhotoPreparation();
    PhotoPreparation(PhotoPreparation&&) noexcept;
    PhotoPreparation& operator=(PhotoPreparation&&) noexcept;

    [[nodiscard]] const PhotoPreparationSettings& settings() const;
    [[nodiscard]] const MorphableHead& head() const;

    /// Reads the landmark model now instead of at the first photo with unknown landmarks. Throws
    /// like FaceDetector.
    void require_detector() const;

    /// The largest face of a photo (height, width, 3) in [0, 1], or all of them, largest first.
    /// Safe from several threads. Throws ValueError with the reason for a photo that cannot be used
    /// (no face in it).
    [[nodiscard]] std::vector<FaceCrop> crops(const Tensor& photo, const KnownOfPhoto& known) const;
    /// Poses and codes of several crops at once, on all threads.
    [[nodiscard]] std::vector<PreparedFace> finish(std::vector<FaceCrop> crops) const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
