#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "core/io/json_writer.h"
#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// The rotation nearest to a matrix that is approximately a rotation. Throws NumericError if the
/// matrix is not finite or has no direction in one of its axes.
[[nodiscard]] Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

/// The rotation R of a Pose from the first 12 outputs of 3DDFA_V2: a row-major 3x4 matrix that maps
/// a face model (x to the image's right, y up, z to the camera) to the image with y up, scaled. Its
/// first two rows without scale are the transpose of R's first two columns. Throws NumericError for
/// numbers that do not define a rotation.
[[nodiscard]] Eigen::Matrix3d rotation_from_3ddfa(std::span<const float> outputs);
/// The rotation R of a Pose from the 9 outputs of 6DRepNet, which are R, row-major, or from the 6
/// of its last layer: R's first column, scaled, and a vector in the plane of the first two. Throws
/// ShapeError for another number of outputs and NumericError for those of no rotation.
[[nodiscard]] Eigen::Matrix3d rotation_from_6drepnet(std::span<const float> outputs);

/// A published network that estimates the pose of a head in a photo, read from an ONNX file. The
/// number of its outputs identifies it: 62, 3DDFA_V2 (input 3x120x120, BGR, (byte - 127.5) / 128);
/// 9 or 6, 6DRepNet (3x224x224, RGB, ImageNet mean and deviation). Not thread-safe.
class PoseNetwork {
public:
    /// Throws FileError for a file that is missing, not an ONNX network, or has other outputs.
    explicit PoseNetwork(const std::filesystem::path& onnx);
    ~PoseNetwork();
    PoseNetwork(PoseNetwork&&) noexcept;
    PoseNetwork& operator=(PoseNetwork&&) noexcept;

    /// The network's input: a fixed box around the face, at the network's resolution, of a photo
    /// (side, side, 3) in [0, 1] that is aligned like FFHQ. Thread-safe. Throws ShapeError for a
    /// photo that is not square.
    [[nodiscard]] Tensor face_box(const Tensor& photo) const;
    /// The rotation R of a Pose from a face_box: the mean over the box and its mirror image, so
    /// that a mirrored photo has exactly the mirrored pose. Throws NumericError if the outputs do
    /// not define a rotation.
    [[nodiscard]] Eigen::Matrix3d rotation(const Tensor& face_box);

private:
    struct Implementation;
    std::unique_ptr<Implementation> implementation_;
};

/// Statistics of one angle over all photos, in degrees.
struct AngleStatistics {
    double mean = 0.0;
    double deviation = 0.0;
    double lowest = 0.0;
    double highest = 0.0;
};

/// Statistics of the poses of a folder, in degrees.
struct PoseStatistics {
    /// Median of a network's pitch, which was subtracted; 0 without a network.
    double pitch_offset = 0.0;
    double roll_offset = 0.0;  ///< the same for the roll
    AngleStatistics yaw, pitch, roll;
};

/// Throws ValueError without poses.
[[nodiscard]] PoseStatistics statistics_of(std::span<const Pose> poses);
/// {"pitch_offset_deg", "roll_offset_deg", "yaw_deg": {"mean", "deviation", "lowest", "highest"},
/// "pitch_deg", "roll_deg"}
[[nodiscard]] JsonValue to_json(const PoseStatistics& statistics);

/// The camera position of a photo that is aligned like FFHQ, if only the rotation of the head is
/// known (pivot_pose).
struct PivotCamera {
    /// Distance of the frontal camera from the head's origin, in world units.
    double distance = 5.3;
    /// World z of the point on the face that is in the middle of every aligned photo.
    double pivot_depth = 0.9;
};

/// The poses of photos that are aligned like FFHQ, from the rotations R that a network found.
/// Networks differ by a constant in what they define as upright, so the medians of pitch and roll
/// over all photos are subtracted and recorded in `statistics`. Throws ValueError without
/// rotations.
[[nodiscard]] std::vector<Pose> poses_from_rotations(std::span<const Eigen::Matrix3d> rotations,
                                                     const PivotCamera& camera,
                                                     PoseStatistics& statistics);

}  // namespace stymo
