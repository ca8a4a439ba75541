#pragma once

#include <cstdint>
#include <optional>

#include "fit/video/film_frame.h"
#include "fit/video/landmark_expression.h"

namespace stymo {

/// Somebody's face before a camera, for moving another face at once. The expression is the one that
/// the landmarks show (LandmarkExpression), with the identity of the first image. It counts from a
/// face at rest, the mean of the first images.
class LiveFace {
public:
    struct Sight {
        /// What is to be added to another face's expression, (1, 79); like what stymo-drive adds,
        /// it is drawn to what the model's faces do (PlausibleChanges).
        Tensor change;
        /// Of the head, as in Pose, relative to the first image, because cameras often stand aside.
        double yaw = 0.0, pitch = 0.0, roll = 0.0;
    };

    /// `preparation` has the `settings_for` the model. Both must outlive the object.
    LiveFace(const PhotoPreparation& preparation, const Model& model);

    /// The face in the next image (height, width, 3) in [0, 1]; nothing if none is found.
    [[nodiscard]] std::optional<Sight> see(const Tensor& image);

private:
    const PhotoPreparation& preparation_;
    const Model& model_;
    LandmarkExpression expression_;
    FaceTracker tracker_;
    Tensor rest_, smooth_;  ///< (1, 79)
    double first_yaw_ = 0.0, first_pitch_ = 0.0, first_roll_ = 0.0;
    std::int64_t seen_ = 0;
    bool starts_ = false;  ///< also where the frame in which the face came back cannot be prepared
};

}  // namespace stymo
