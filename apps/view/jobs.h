#pragma once

#include <string>

#include "apps/view/job.h"
#include "apps/view/request.h"
#include "apps/view/session.h"

namespace stymo::view {

/// Requests of the page that take seconds. Each function returns the body of a Job. The shared
/// state and the session must outlive the job.

/// Finds, masks and fits the face of a photo, whose file has the bytes `photo`. `cover` has those
/// of a mask that is white where something covers the face; empty: nothing does. The face is in the
/// list from the first step on and is updated during the fit. Then the decoder is tuned to it for
/// `tune_seconds`. `number`: which face of the photo, counted from the left; 0: the largest.
[[nodiscard]] Job::Body fit_photo(SharedState& shared, Session& session, std::string photo,
                                  std::string cover, double tune_seconds, std::int64_t number);

/// Changes the colour of a part of a face.
[[nodiscard]] Job::Body recolor(SharedState& shared, Session& session, const ListedFace& shown,
                                const ColorQuery& query);

/// A film of a face, rendered like moving frames.
[[nodiscard]] Job::Body film(SharedState& shared, const ListedFace& face, const FilmQuery& query);

/// The surface of a face as a PLY file.
[[nodiscard]] Job::Body mesh(SharedState& shared, const ListedFace& face);

/// The weights of a tuned face as a file for --tuned.
[[nodiscard]] Job::Body save_tuned(SharedState& shared, const ListedFace& face);

/// The inverse of `save_tuned`: adds a new face with the codes of this one and the weights of the
/// file with the bytes `weights`.
[[nodiscard]] Job::Body open_tuned(SharedState& shared, Session& session, const ListedFace& face,
                                   std::string weights);

}  // namespace stymo::view
