#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/tensor.h"
#include "render/morphable/head.h"

/// Code that the readers of scanned heads share. Not part of the public interface.
namespace stymo::morphable {

/// A linear model in the units of its files: centimetres, x to the image's right, y up, z out of
/// the face.
struct ScannedHead {
    std::string name;   ///< name of the file or folder, for messages
    Tensor mean;        ///< (V, 3) float32
    Tensor identity;    ///< (up to 100, V, 3), in units of one standard deviation
    Tensor expression;  ///< (1 to 79, V, 3), one-sided shapes at full strength
    std::vector<std::array<std::int32_t, 3>> triangles;
    std::array<std::int32_t, 68> landmarks{};
    std::vector<std::string> expression_names;  ///< empty: not known
};

/// Moves a scan into the frame of the built-in head: scale * point + offset.
struct HeadFrame {
    double scale;
    Eigen::Vector3d offset;
};

/// The frame in which the corners of eyes and mouth of the points (V, 3) have the height and depth
/// that they have on the built-in head. Throws FileError, which begins with `name`, if the eyes do
/// not lie above the mouth.
[[nodiscard]] HeadFrame head_frame(const Tensor& points,
                                   const std::array<std::int32_t, 68>& landmarks,
                                   const std::string& name);

/// Moves and scales the head so that its eyes and mouth are at the positions of the built-in head,
/// fills the bases up with zero rows, removes the triangles of the neck, and adds parts and the
/// smooth colour basis of the built-in head. Throws FileError if the landmarks of eyes and mouth
/// are not arranged as in a face.
[[nodiscard]] MorphableHead head_from_scans(const ScannedHead& scanned);

}  // namespace stymo::morphable
