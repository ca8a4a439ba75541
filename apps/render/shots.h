#pragma once

#include <string>
#include <vector>

#include "apps/render/options.h"
#include "nn/models/code_file.h"

namespace stymo {

/// One face seen by one camera.
struct Shot {
    Codes codes;  ///< one row
    Pose pose;
};

/// Images that belong together: the frames of an animation, or tiles of one image.
struct ShotList {
    std::vector<Shot> shots;
    int columns = 1;         ///< number of tiles in a row of the image
    bool returning = false;  ///< an animation shows the shots forwards and then backwards
};

/// The pose with the angles of the options; without angles, the pose `face`.
[[nodiscard]] Pose chosen_pose(const RenderOptions& options, const Model& model, const Pose& face);

/// The shots that the options select: an orbit, a grid, an interpolation or one view of a face.
/// Throws FileError for an unreadable --to.
[[nodiscard]] ShotList shots_of_face(const RenderOptions& options, const Model& model,
                                     const CodeFile& face);

/// Throws UsageError for malformed grids and groups.
void require_understood(const RenderOptions& options);

/// Linear interpolation in Z from `from` (part = 0) to `to` (part = 1) of the groups in the
/// comma-separated list `take` (empty: all groups). Other groups keep the values of `from`.
[[nodiscard]] Codes interpolated(const Codes& from, const Codes& to, double part,
                                 const std::string& take);

}  // namespace stymo
