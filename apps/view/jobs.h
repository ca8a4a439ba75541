#pragma once

#include <string>
#include <vector>

#include "apps/view/job.h"
#include "apps/view/session.h"

namespace stymo::view {

/// What the page asks for that takes seconds. Each is the body of a Job of this session, which
/// outlives it.

/// Finds, masks and fits the face of a photo, given as the bytes of its file. The face is on the
/// shelf from the first step on and changes as the fit goes on. Then the decoder is tuned to it for
/// so many seconds.
[[nodiscard]] Job::Body fit_photo(Studio& studio, Session& session, std::string photo,
                                  const std::string& name, double tune_seconds);

/// Gives the part of the face at (x, y) of the image, both in [0, 1], another colour.
struct ColorWish {
    std::string face;
    std::array<std::vector<double>, code_names.size()> sliders;
    Camera camera;
    double x = 0.5;
    double y = 0.5;
    Eigen::Vector3d color = Eigen::Vector3d::Zero();
};
[[nodiscard]] Job::Body recolor(Studio& studio, Session& session, const ShelfFace& shown,
                                const ColorWish& wish);

/// A film along a path of cameras, rendered as moving frames are; `extension` is ".gif" or ".mp4".
struct FilmWish {
    ShelfFace face;
    std::vector<Camera> cameras;
    double frames_per_second = 24.0;
    std::string extension;
};
[[nodiscard]] Job::Body film(Studio& studio, const FilmWish& wish);

/// The surface of a face as a PLY file.
[[nodiscard]] Job::Body mesh(Studio& studio, const ShelfFace& face);

}  // namespace stymo::view
