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
#include "fit/photo/photo_look.h"
#include "fit/photo/pose_network.h"
#include "render/camera.h"
#include "render/morphable/head.h"

namespace stymo {

class FaceDetector;

struct PhotoPreparationSettings {
    std::int64_t side = 256;       ///< side of the resulting images and masks, in pixels
    std::int64_t wanted_side = 0;  ///< a crop from fewer pixels than this gets a warning; 0: `side`
    /// A crop from fewer pixels than this is refused; 0: than a quarter of the wanted side.
    std::int64_t least_side = 0;
    Intrinsics intrinsics;                         ///< intrinsics for which poses are found
    std::int64_t most_pixels = usual_most_pixels;  ///< photos with more pixels are rejected
    std::int64_t face = 0;   ///< the face to prepare, counted from the left; 0: the clearest
    bool all_faces = false;  ///< prepares all faces of a photo; else the clearest
    bool new_masks = false;  ///< makes masks even if they are known, and compares both
    /// Widens FFHQ's square, up to 1.5 times, while the head leaves it at the top or the sides.
    /// Photos that are already aligned stay as they are.
    bool whole_head = false;
    std::string no_face_advice{};  ///< follows the error for a photo without a face
    PivotCamera pivot;             ///< camera position for poses from a network
    // Optional files; an empty path means that the file is not used.
    std::filesystem::path landmark_model;  ///< for FaceDetector; empty: that of libdlib-data
    /// Head-mask network (nn/pretrained/head_mask_network.h). Without it, a photo whose mask is not
    /// known is refused.
    std::filesystem::path mask_network;
    std::filesystem::path pose_network;  ///< ONNX file of a pose network, whose rotations are found
                                         ///< in addition to the morphable fit's poses
    /// Head to fit (morphable_head_from); empty: the built-in one.
    std::filesystem::path morphable;
};

/// Known mask and landmarks of a photo, in its own frame.
struct KnownOfPhoto {
    /// (height, width, 1), of any size with the photo's aspect ratio; may be undefined.
    Tensor mask{};
    /// In pixels of the photo; if given, no face is searched for.
    std::optional<Landmarks> landmarks{};
    /// (height, width, 1) like `mask`, see nn/known_pixels.h; undefined: all pixels are known.
    Tensor known{};
};

/// One face cut out of a photo with FFHQ's alignment (or more of the photo, see `whole_head`), or
/// the photo itself if it was already aligned.
struct FaceCrop {
    Tensor image;         ///< (side, side, 3) in [0, 1]
    Tensor mask;          ///< (side, side, 1) in [0, 1], 1 on the head
    Tensor known;         ///< (side, side, 1); undefined: all pixels are known
    Landmarks landmarks;  ///< in pixels of `image`
    bool was_aligned = false;
    bool made_mask = false;  ///< whether the mask was made here
    /// Intersection over union of the made mask and a known one, if there are both.
    std::optional<double> mask_agreement;
    std::int64_t faces = 1;      ///< number of faces found in the photo, unless one was named
    int quarter_turns = 0;       ///< clockwise turns of the photo after which the face was found
    double side_in_photo = 0.0;  ///< side of the crop in pixels of the photo
    double share_outside = 0.0;  ///< share of the crop's area outside the photo
    PhotoLook look{};            ///< of `fit_target`
    MorphableFitTarget
        fit_target;   ///< image, mask and landmarks at the resolution of the morphable fit
    Tensor face_box;  ///< input of the pose network, if there is one
};

/// A face with pose and codes.
struct PreparedFace {
    FaceCrop crop;
    MorphableFit fit;
    std::optional<Eigen::Matrix3d> network_rotation;
    std::vector<std::string> warnings;
    std::string failure;  ///< why the face cannot be used; empty if it can
};

/// Prepares photos: faces in FFHQ's frame with masks, poses and codes. The steps are landmarks,
/// alignment, a mask by the head-mask network, a morphable fit and a pose network.
class PhotoPreparation {
public:
    /// Reads the networks and the head. Throws FileError for a file that is missing or has another
    /// content.
    explicit PhotoPreparation(const PhotoPreparationSettings& settings);
    ~PhotoPreparation();
    PhotoPreparation(PhotoPreparation&&) noexcept;
    PhotoPreparation& operator=(PhotoPreparation&&) noexcept;

    [[nodiscard]] const PhotoPreparationSettings& settings() const;
    [[nodiscard]] const MorphableHead& head() const;

    /// Reads the landmark model, unless that was done before. Throws like FaceDetector.
    const FaceDetector& detector() const;  // NOLINT(modernize-use-nodiscard)

    /// The clearest face of a photo (height, width, 3) in [0, 1], or that with the number
    /// `settings.face`, or all of them, clearest first. If none or only a doubtful one is
    /// found, and no landmarks are known, the photo is also searched turned by 90, 180 and 270
    /// degrees. Thread-safe. Throws
    /// ValueError with the reason for a photo that cannot be used (no face in it).
    [[nodiscard]] std::vector<FaceCrop> crops(const Tensor& photo, const KnownOfPhoto& known) const;
    /// The crop of a film's frame whose landmarks are known, faster: everything at `wanted_side`.
    /// It is faster still without a mask, which then is 1 everywhere. Thread-safe.
    [[nodiscard]] FaceCrop frame_crop(const Tensor& frame, const Landmarks& landmarks,
                                      bool has_mask = true) const;
    /// Poses and codes of several crops at once, on all threads. Thread-safe.
    /// `options`: those of the morphable fits.
    [[nodiscard]] std::vector<PreparedFace> finish(std::vector<FaceCrop> crops,
                                                   const MorphableFitOptions& options = {}) const;

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

}  // namespace stymo
