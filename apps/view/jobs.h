#pragma once

#include <string>
#include <vector>

#include "apps/view/job.h"
#include "apps/view/session.h"

namespace stymo::view {

/// Requests of the page that take seconds. Each function returns the body of a Job. Studio and
/// session must outlive the job.

/// Finds, masks and fits the face of a photo, whose file has the bytes `photo`. The face is on the
/// shelf from the first step on and is updated during the fit. Then the decoder is tuned to it for
/// `tune_seconds`.
[[nodiscard]] Job::Body fit_photo(Studio& studio, Session& session, std::string photo,
                                  const std::string& name, double tune_seconds);

/// A request to change the colour of the part of the face at (x, y) of the image, both in [0, 1].
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

/// A request for a film along a path of cameras, rendered like moving frames. `extension` is ".gif"
/// or ".mp4".
struct FilmWish {
    ShelfFace face;
    std::vector<Camera> cameras;
    double frames_per_second = 24.0;
    std::string extension;
};
[[nodiscard]] Job::Body film(Studio& studio, const FilmWish& wish);

/// The surface of a face as a PLY file.
[[nodiscard]] Job::Body mesh(Studio& studio, const ShelfFace& face);

/// The weights of a tuned face as a file for --tuned.
[[nodiscard]] Job::Body save_tuned(Studio& studio, const ShelfFace& face);

/// The inverse of `save_tuned`: adds a new face with the codes of this one and the weights of the
/// file with the bytes `weights`.
[[nodiscard]] Job::Body open_tuned(Studio& studio, Session& session, const ShelfFace& face,
                                   std::string weights);

}  // namespace stymo::view
