#include "fit/photo/pose_network.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <string>

#include "core/error.h"
#include "core/io/image.h"
#include "fit/photo/onnx_network.h"

namespace stymo {
namespace {

/// Where the network's input lies in an aligned photo (units of its side), and how it wants the pixels.
struct NetworkKind {
    std::int64_t outputs;
    int input_side;
    double box_side;
    double box_center_y;
    PixelScale scale;
    Matrix3 (*rotation)(std::span<const float>);
};

// Sides 0.65 to 0.75 and centres 0.53 to 0.59 serve 3DDFA_V2 about equally, judged by how well the poses of 400 photos agree with
// those of their mirror images. 6DRepNet expects the box of a face detector, about half of a photo, enlarged by a fifth on each
// side.
constexpr std::array kinds = {
    NetworkKind{62, 120, 0.65, 0.56, {{0.5F, 0.5F, 0.5F}, {128.0F / 255, 128.0F / 255, 128.0F / 255}, true}, rotation_from_3ddfa},
    NetworkKind{9, 224, 0.70, 0.56, {{0.485F, 0.456F, 0.406F}, {0.229F, 0.224F, 0.225F}}, rotation_from_6drepnet},
};

/// The kind whose input the network accepts and whose number of outputs it then gives; null if there is none.
const NetworkKind* kind_of(OnnxNetwork& network) {
    for (const NetworkKind& kind : kinds) {
        try {
            const Tensor grey = Tensor::full({kind.input_side, kind.input_side, 3}, 0.5);
            if (std::ssize(network.run(grey, kind.scale).values) == kind.outputs) return &kind;
        } catch (const ShapeError&) {
            // An input size the network was not made for.
        }
    }
    return nullptr;
}

Matrix3 mirrored(const Matrix3& rotation) {
    const auto& [x, y, z] = rotation;
    return {{{x[0], -x[1], -x[2]}, {-y[0], y[1], y[2]}, {-z[0], z[1], z[2]}}};
}

Matrix3 sum(Matrix3 a, const Matrix3& b) {
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) a[i][j] += b[i][j];
    return a;
}

Vector3 unit_row(std::span<const float> row) {
    const double length = std::hypot(row[0], row[1], row[2]);
    return {row[0] / length, row[1] / length, row[2] / length};
}

}  // namespace

Matrix3 nearest_rotation(const Matrix3& matrix) {
    cv::Matx33d values;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            values(i, j) = matrix[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
            if (!std::isfinite(values(i, j))) fail<NumericError>("a rotation with numbers that are not finite");
        }
    cv::Matx31d scales;
    cv::Matx33d left, right;
    cv::SVD::compute(values, scales, left, right);
    constexpr double degenerate = 1e-6;
    if (!(scales(2) > degenerate * scales(0))) fail<NumericError>("a rotation that has no direction in one of its axes");
    const double handedness = cv::determinant(left * right) < 0 ? -1.0 : 1.0;
    const cv::Matx33d nearest = left * cv::Matx33d::diag({1.0, 1.0, handedness}) * right;
    Matrix3 result{};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) result[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] = nearest(i, j);
    return result;
}

Matrix3 rotation_from_3ddfa(std::span<const float> outputs) {
    if (outputs.size() < 12) fail<ShapeError>("3DDFA_V2 gives at least 12 numbers; got ", outputs.size());
    const Vector3 x = unit_row(outputs.subspan(0, 3));
    const Vector3 y = unit_row(outputs.subspan(4, 3));
    const Vector3 z = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
    return nearest_rotation({{{x[0], y[0], z[0]}, {x[1], y[1], z[1]}, {x[2], y[2], z[2]}}});
}

Matrix3 rotation_from_6drepnet(std::span<const float> outputs) {
    if (outputs.size() != 9) fail<ShapeError>("6DRepNet gives 9 numbers; got ", outputs.size());
    Matrix3 matrix{};
    for (std::size_t i = 0; i < 9; ++i) matrix[i / 3][i % 3] = outputs[i];
    return nearest_rotation(matrix);
}

struct PoseNetwork::Implementation {
    OnnxNetwork network;
    const NetworkKind* kind;
};

PoseNetwork::PoseNetwork(const std::filesystem::path& onnx)
    : implementation_(std::make_unique<Implementation>(Implementation{OnnxNetwork(onnx), nullptr})) {
    implementation_->kind = kind_of(implementation_->network);
    if (implementation_->kind == nullptr)
        fail<FileError>(onnx.string(),
                        ": not a known pose network; 3DDFA_V2 (3x120x120 to 62 numbers) and 6DRepNet (3x224x224 to 9) are");
}

PoseNetwork::~PoseNetwork() = default;
PoseNetwork::PoseNetwork(PoseNetwork&&) noexcept = default;
PoseNetwork& PoseNetwork::operator=(PoseNetwork&&) noexcept = default;

Tensor PoseNetwork::face_box(const Tensor& photo) const {
    if (photo.rank() != 3 || photo.shape(0) != photo.shape(1) || photo.shape(2) != 3)
        fail<ShapeError>("[pose network] a photo is (side, side, 3); got ", photo.shape());
    const NetworkKind& kind = *implementation_->kind;
    const std::int64_t photo_side = photo.shape(0);
    const auto pixels = [&](double length) -> std::int64_t { return std::llround(length * static_cast<double>(photo_side)); };
    const std::int64_t rounded = std::max<std::int64_t>(pixels(kind.box_side), 1);
    // The same number of pixels on either side: half a pixel to one side already turns the mirrored pose by half a degree.
    const std::int64_t side = rounded + (photo_side - rounded) % 2;
    const std::int64_t left = (photo_side - side) / 2;
    const std::int64_t top = std::min(pixels(kind.box_center_y - kind.box_side / 2), photo_side - side);
    const Tensor box = image_part(photo, top, left, side, side);
    return resize_image(box, kind.input_side, kind.input_side);
}

Matrix3 PoseNetwork::rotation(const Tensor& face_box) {
    const NetworkKind& kind = *implementation_->kind;
    if (!(face_box.shape() == Shape{kind.input_side, kind.input_side, 3}))
        fail<ShapeError>("[pose network] the face box is ", kind.input_side, " pixels wide and high; got ", face_box.shape());
    const Matrix3 direct = kind.rotation(implementation_->network.run(face_box, kind.scale).values);
    const Matrix3 through_mirror =
        mirrored(kind.rotation(implementation_->network.run(mirror_image(face_box), kind.scale).values));
    return nearest_rotation(sum(direct, through_mirror));
}

}  // namespace stymo
