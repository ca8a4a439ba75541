#pragma once

#include <string>
#include <vector>

#include "apps/render/options.h"
#include "nn/models/code_file.h"

namespace stymo {

/// One face before one camera.
struct Shot {
    Codes codes;  ///< one row
    Pose pose;
};

/// Images that belong together: the frames of an animation, or tiles of one image.
struct ShotList {
    std::vector<Shot> shots;
    int columns = 1;         ///< of the image
    bool returning = false;  ///< as an animation they are shown there and back again
};

/// The pose of the options' angles, or else of `face`.
[[nodiscard]] Pose chosen_pose(const RenderOptions& options, const Model& model, const Pose& face);

/// The shots of a face that the options select: an orbit, a grid, an interpolation or one view.
/// Throws FileError for an unreadable --to.
[[nodiscard]] ShotList shots_of_face(const RenderOptions& options, const Model& model,
                                     const CodeFile& face);

/// Throws UsageError for malformed grids and groups.
void require_understood(const RenderOptions& options);

/// From `from` (part = 0) to `to` (part = 1) in Z, the groups of the comma-separated list `take`;
/// the others stay as they are. Empty: all groups.
[[nodiscard]] Codes interpolated(const Codes& from, const Codes& to, double part,
                                 const std::string& take);

}  // namespace stymo
