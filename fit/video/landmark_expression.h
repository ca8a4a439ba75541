#pragma once

#include <span>
#include <vector>

#include "fit/expression_prior.h"
#include "fit/video/film_frame.h"
#include "nn/models/model.h"

namespace stymo {

/// What the landmarks of one person's face say about its expression. They say more than the
/// encoder, whose codes hardly move with a mouth.
class LandmarkExpression {
public:
    /// `preparation` must outlive the object.
    LandmarkExpression(const PhotoPreparation& preparation, const Model& model);

    /// The person: the mean of the prepared faces' identities, which are those of the linear head.
    void know(std::span<const FrameInWork> faces);
    /// Sets FilmFrame::change of prepared faces after know(): the expression of the linear
    /// head with this identity, drawn to what the model's faces do (PlausibleChanges). Throws like
    /// fit_morphable.
    void see(std::span<FrameInWork> faces) const;

private:
    const PhotoPreparation& preparation_;
    PlausibleChanges plausible_;
    std::vector<float> identity_;
};

}  // namespace stymo
