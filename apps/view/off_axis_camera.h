#pragma once

#include "render/camera.h"

namespace stymo {

/// A square window in the world through which a head is seen, such as a screen. Its plane is
/// perpendicular to the world's z axis, and the viewer is in front of it, at greater z.
struct Window {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< in world coordinates
    double side = 2.0;                                 ///< in world units
};

/// The camera whose image, shown in the window, equals the eye's view through the window: an
/// off-axis frustum from the eye through the window's corners (Kooima 2009, "Generalized
/// perspective projection"). A point in the window's plane has the same image point for
/// every position of the eye. Throws ValueError unless the eye is in front of the window.
[[nodiscard]] Camera off_axis_camera(const Window& window, const Eigen::Vector3d& eye);

}  // namespace stymo
