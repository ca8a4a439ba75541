#pragma once

#include "render/morphable/head_generator.h"

/// The skin of the built-in head is a loft of horizontal oval sections. The features of the face
/// are added at the front.
namespace stymo::morphable {

/// Section of the head at profile parameter s in [0, 1], crown to throat.
struct Section {
    double height;
    double half_width;
    double front;
    double back;
};

[[nodiscard]] Section section_at(double s);
/// Inverse of section_at(s).height, above the chin.
[[nodiscard]] double profile_parameter(double height);
/// Point of the bald, featureless head. `angle` runs around the y axis from 0 at the front to +-pi
/// at the back; positive angles are towards +x.
[[nodiscard]] Eigen::Vector3d loft_point(double s, double angle);
/// Point of the front at x and y, with nose, eye sockets and other features, with closed eyes and
/// flat lips.
[[nodiscard]] Eigen::Vector3d face_point(double x, double y, const HeadParameters& parameters);
/// Centre of the eyeball at the image's right.
[[nodiscard]] Eigen::Vector3d eye_center(const HeadParameters& parameters);

/// exp(-x^2).
[[nodiscard]] double gauss(double x);
/// 0 below `low`, 1 above `high`, smooth between; `low` may be the greater one.
[[nodiscard]] double smooth_step(double low, double high, double x);
[[nodiscard]] Eigen::Vector3d mix(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                  double weight);

}  // namespace stymo::morphable
