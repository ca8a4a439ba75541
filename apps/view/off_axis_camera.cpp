#include "apps/view/off_axis_camera.h"

#include "core/error.h"

namespace stymo {

Camera off_axis_camera(const Window& window, const Eigen::Vector3d& eye) {
    const Eigen::Vector3d offset = eye - window.center;
    if (!(offset.z() > 0.0) || !(window.side > 0.0))
        fail<ValueError>("the eye must be in front of a window with a positive side");
    Camera camera = camera_from_pose({.translation = eye}, {});
    // In units of the window's side, x to the right and y down.
    camera.intrinsics = {.focal = offset.z() / window.side,
                         .center_x = 0.5 + offset.x() / window.side,
                         .center_y = 0.5 - offset.y() / window.side};
    return camera;
}

}  // namespace stymo
