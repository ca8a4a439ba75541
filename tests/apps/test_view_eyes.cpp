// Where the viewer's eyes are, against closed forms.
#include <catch2/catch.hpp>
#include <cmath>

#include "apps/view/eye_tracker.h"

using namespace stymo;
using namespace stymo::view;

namespace {

/// The landmarks of eyes around `eye` (metres, from the camera) that a camera of this field of view
/// sees straight ahead in an image of this width and height.
Landmarks seen_eyes(const Eigen::Vector3d& eye, double width, double height, double fov) {
    const double focal = 0.5 * width / std::tan(0.5 * fov);
    Landmarks landmarks;
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
        const double side = i >= 42 ? -0.5 : 0.5;  // of the image: the viewer's left is its right
        const Eigen::Vector3d point = eye + Eigen::Vector3d(side * pupil_distance, 0.0, 0.0);
        landmarks[i] = {0.5 * width - focal * point[0] / point[2],
                        0.5 * height - focal * point[1] / point[2]};
    }
    return landmarks;
}

}  // namespace

TEST_CASE("the eye point is where the eyes are, whatever the camera", "[view]") {
    for (const Eigen::Vector3d& eye :
         {Eigen::Vector3d(0.0, 0.0, 0.5), Eigen::Vector3d(0.15, -0.1, 0.7),
          Eigen::Vector3d(-0.2, 0.05, 0.35)}) {
        for (const double fov : {0.8, 1.05, 1.4}) {
            EyeCamera camera{.field_of_view = fov, .position = {0.02, 0.12, 0.01}};
            const Eigen::Vector3d found =
                eye_point(seen_eyes(eye, 320.0, 240.0, fov), 320.0, 240.0, camera);
            CHECK((found - (camera.position + eye)).norm() < 1e-9);
        }
    }
}
