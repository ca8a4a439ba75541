#pragma once

#include <array>
#include <vector>

#include "fit/morphable/landmark_term.h"
#include "fit/morphable/morphable_fit.h"
#include "fit/morphable/vertex_table.h"
#include "support/morphable_state.h"

namespace stymo::test {

/// The 68 landmarks of the fitted head, with the jaw's on the outline, in pixels of an image of
/// this side.
inline Landmarks fitted_landmarks(const MorphableHead& head, const MorphableFit& fit,
                                  const Intrinsics& intrinsics, std::int64_t side) {
    const morphable::Contour contour(head);
    const std::vector<double> points = morphable::table_points(contour.table(), state_of(fit));
    const Camera camera = camera_from_pose(fit.pose, intrinsics);
    const std::array<std::size_t, 68> rows = contour.rows(points, camera);
    Landmarks result;
    for (std::size_t k = 0; k < result.size(); ++k) {
        const Eigen::Vector3d seen =
            project(camera, Eigen::Map<const Eigen::Vector3d>(&points[3 * rows[k]]));
        result[k] = seen.head<2>() * static_cast<double>(side);
    }
    return result;
}

}  // namespace stymo::test
