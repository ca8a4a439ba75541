#include "fit/photo/pose_network.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/angle.h"
#include "core/error.h"
#include "core/io/image.h"
#include "core/median.h"
#include "fit/photo/onnx_network.h"

namespace stymo {

namespace {

/// The crop of an aligned photo that is the network's input (units of the photo's side), and its
/// pixel values.
struct NetworkKind {
    std::int64_t outputs;
    int input_side;
    double box_side;
    double box_center_y;
    PixelScale scale;
    Eigen::Matrix3d (*rotation)(std::span<const float>);
};

// With the last layer's 6 numbers, or with the matrix that is computed from them.
constexpr NetworkKind of_6drepnet(std::int64_t outputs) {
    return {outputs,
            224,
            0.70,
            0.56,
            {{0.485F, 0.456F, 0.406F}, {0.229F, 0.224F, 0.225F}},
            rotation_from_6drepnet};
}

constexpr std::int64_t outputs_of_3ddfa = 62;
/// Its matrix maps a model in micrometres to pixels, so that rows have a length of about 5e-4.
/// Numbers that are still normalised are about 1.
constexpr float most_scale_of_3ddfa = 0.02F;

// Sides 0.65 to 0.75 and centres 0.53 to 0.59 give 3DDFA_V2 about the same agreement between the
// poses of 400 photos and of their mirror images. 6DRepNet expects the box of a face detector,
// about half of a photo, enlarged by a fifth on each side.
constexpr std::array kinds = {
    NetworkKind{outputs_of_3ddfa,
                120,
                0.65,
                0.56,
                {{0.5F, 0.5F, 0.5F}, {128.0F / 255, 128.0F / 255, 128.0F / 255}, true},
                rotation_from_3ddfa},
    of_6drepnet(9),
    of_6drepnet(6),
};

/// The kind whose input size and number of outputs the network has.
const NetworkKind* kind_of(OnnxNetwork& network, const std::string& name) {
    std::string found;
    for (const NetworkKind& kind : kinds) {
        try {
            const Tensor grey = Tensor::full({kind.input_side, kind.input_side, 3}, 0.5);
            const std::vector<float> values = network.run(grey, kind.scale).values;
            const std::ptrdiff_t outputs = std::ssize(values);
            if (outputs == outputs_of_3ddfa && outputs == kind.outputs &&
                Eigen::Vector3f(values.data()).norm() > most_scale_of_3ddfa)
                fail<FileError>(name,
                                ": 3DDFA_V2's normalised outputs; let the file end with output * "
                                "param_std + param_mean of its param_mean_std_62d_120x120.pkl");
            if (outputs == kind.outputs) return &kind;
            found = "it gives " + std::to_string(outputs) + " numbers";
        } catch (const ShapeError& error) {
            const std::string reason = error.what();
            if (found.empty() || reason.find("OpenCV") != std::string::npos) found = reason;
        }
    }
    fail<FileError>(name, ": not a known pose network (", found,
                    "); 3DDFA_V2 (3x120x120 to 62 numbers) and 6DRepNet (3x224x224 to 9, or to 6 "
                    "before their rotation) are");
}

/// The rotation of the head in the mirror image.
Eigen::Matrix3d mirrored(const Eigen::Matrix3d& rotation) {
    const Eigen::DiagonalMatrix<double, 3> mirror(-1.0, 1.0, 1.0);
    return mirror * rotation * mirror;
}

}  // namespace

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
    if (!matrix.allFinite()) fail<NumericError>("a rotation with numbers that are not finite");
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
    constexpr double degenerate = 1e-6;
    if (!(svd.singularValues()[2] > degenerate * svd.singularValues()[0]))
        fail<NumericError>("a rotation that has no direction in one of its axes");
    Eigen::Matrix3d left = svd.matrixU();
    if (left.determinant() * svd.matrixV().determinant() < 0.0) left.col(2) *= -1.0;
    return left * svd.matrixV().transpose();
}

Eigen::Matrix3d rotation_from_3ddfa(std::span<const float> outputs) {
    if (outputs.size() < 12)
        fail<ShapeError>("3DDFA_V2 gives at least 12 numbers; got ", outputs.size());
    const Eigen::Vector3d x = Eigen::Vector3f(outputs.data()).cast<double>().normalized();
    const Eigen::Vector3d y = Eigen::Vector3f(&outputs[4]).cast<double>().normalized();
    Eigen::Matrix3d matrix;
    matrix << x, y, x.cross(y);
    return nearest_rotation(matrix);
}

Eigen::Matrix3d rotation_from_6drepnet(std::span<const float> outputs) {
    if (outputs.size() == 6) {
        const Eigen::Vector3d x = Eigen::Vector3f(outputs.data()).cast<double>().normalized();
        const Eigen::Vector3d z = x.cross(Eigen::Vector3f(&outputs[3]).cast<double>()).normalized();
        Eigen::Matrix3d matrix;
        matrix << x, z.cross(x), z;
        return nearest_rotation(matrix);
    }
    if (outputs.size() != 9)
        fail<ShapeError>("6DRepNet gives 6 or 9 numbers; got ", outputs.size());
    const Eigen::Matrix3f transposed(outputs.data());
    return nearest_rotation(transposed.transpose().cast<double>());
}

struct PoseNetwork::Implementation {
    OnnxNetwork network;
    const NetworkKind* kind;
};

PoseNetwork::PoseNetwork(const std::filesystem::path& onnx)
    : implementation_(
          std::make_unique<Implementation>(Implementation{OnnxNetwork(onnx), nullptr})) {
    implementation_->kind = kind_of(implementation_->network, onnx.string());
}

PoseNetwork::~PoseNetwork() = default;
PoseNetwork::PoseNetwork(PoseNetwork&&) noexcept = default;
PoseNetwork& PoseNetwork::operator=(PoseNetwork&&) noexcept = default;

Tensor PoseNetwork::face_box(const Tensor& photo) const {
    if (photo.rank() != 3 || photo.shape(0) != photo.shape(1) || photo.shape(2) != 3)
        fail<ShapeError>("[pose network] a photo is (side, side, 3); got ", photo.shape());
    const NetworkKind& kind = *implementation_->kind;
    const std::int64_t photo_side = photo.shape(0);
    const auto pixels = [&](double length) -> std::int64_t {
        return std::llround(length * static_cast<double>(photo_side));
    };
    const std::int64_t rounded = std::max<std::int64_t>(pixels(kind.box_side), 1);
    // The same number of pixels on either side: half a pixel to one side already turns the mirrored
    // pose by half a degree.
    const std::int64_t side = rounded + (photo_side - rounded) % 2;
    const std::int64_t left = (photo_side - side) / 2;
    const std::int64_t top =
        std::min(pixels(kind.box_center_y - kind.box_side / 2), photo_side - side);
    const Tensor box = image_part(photo, top, left, side, side);
    return resize_image(box, kind.input_side, kind.input_side);
}

Eigen::Matrix3d PoseNetwork::rotation(const Tensor& face_box) {
    const NetworkKind& kind = *implementation_->kind;
    if (!(face_box.shape() == Shape{kind.input_side, kind.input_side, 3}))
        fail<ShapeError>("[pose network] the face box is ", kind.input_side,
                         " pixels wide and high; got ", face_box.shape());
    const Eigen::Matrix3d direct =
        kind.rotation(implementation_->network.run(face_box, kind.scale).values);
    const Eigen::Matrix3d through_mirror = mirrored(
        kind.rotation(implementation_->network.run(mirror_image(face_box), kind.scale).values));
    return nearest_rotation(direct + through_mirror);
}

namespace {

AngleStatistics statistics_of(std::span<const Pose> poses, double Pose::*angle) {
    AngleStatistics result{0.0, 0.0, poses.front().*angle, poses.front().*angle};
    const auto count = static_cast<double>(poses.size());
    for (const Pose& pose : poses) {
        result.mean += pose.*angle / count;
        result.lowest = std::min(result.lowest, pose.*angle);
        result.highest = std::max(result.highest, pose.*angle);
    }
    double variance = 0.0;
    for (const Pose& pose : poses)
        variance += (pose.*angle - result.mean) * (pose.*angle - result.mean) / count;
    result.deviation = std::sqrt(variance);
    for (double* value : {&result.mean, &result.deviation, &result.lowest, &result.highest})
        *value = degrees_from_radians(*value);
    return result;
}

JsonValue to_json(const AngleStatistics& angle) {
    return JsonValue::object({{"mean", angle.mean},
                              {"deviation", angle.deviation},
                              {"lowest", angle.lowest},
                              {"highest", angle.highest}});
}

}  // namespace

PoseStatistics statistics_of(std::span<const Pose> poses) {
    if (poses.empty()) fail<ValueError>("[poses] there are no poses");
    return {.yaw = statistics_of(poses, &Pose::yaw),
            .pitch = statistics_of(poses, &Pose::pitch),
            .roll = statistics_of(poses, &Pose::roll)};
}

JsonValue to_json(const PoseStatistics& statistics) {
    return JsonValue::object({{"pitch_offset_deg", statistics.pitch_offset},
                              {"roll_offset_deg", statistics.roll_offset},
                              {"yaw_deg", to_json(statistics.yaw)},
                              {"pitch_deg", to_json(statistics.pitch)},
                              {"roll_deg", to_json(statistics.roll)}});
}

std::vector<Pose> poses_from_rotations(std::span<const Eigen::Matrix3d> rotations,
                                       const PivotCamera& camera, PoseStatistics& statistics) {
    if (rotations.empty()) fail<ValueError>("[poses] there are no rotations");
    std::vector<Eigen::Vector3d> angles;
    std::vector<double> pitches, rolls;
    for (const Eigen::Matrix3d& rotation : rotations) {
        angles.push_back(angles_from_rotation(rotation));
        pitches.push_back(angles.back()[1]);
        rolls.push_back(angles.back()[2]);
    }
    const double pitch_offset = median(pitches);
    const double roll_offset = median(rolls);
    std::vector<Pose> poses;
    for (const Eigen::Vector3d& angle : angles)
        poses.push_back(pivot_pose(angle[0], angle[1] - pitch_offset, angle[2] - roll_offset,
                                   camera.distance, camera.pivot_depth));
    statistics = statistics_of(poses);
    statistics.pitch_offset = degrees_from_radians(pitch_offset);
    statistics.roll_offset = degrees_from_radians(roll_offset);
    return poses;
}

}  // namespace stymo
