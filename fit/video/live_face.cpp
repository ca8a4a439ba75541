#include "fit/video/live_face.h"

#include <utility>

#include "core/ops/ops.h"

namespace stymo {

namespace {

/// Of the images, for the filter of landmarks; browsers and processors differ.
constexpr double usual_rate = 15.0;

Tensor between(const Tensor& from, const Tensor& to, double part) {
    return (Variable(from) + (Variable(to) - Variable(from)) * part).value();
}

}  // namespace

LiveFace::LiveFace(const PhotoPreparation& preparation, const Model& model)
    : preparation_(preparation),
      model_(model),
      expression_(preparation, model),
      tracker_(preparation.detector(), usual_rate) {}

std::optional<LiveFace::Sight> LiveFace::see(const Tensor& image) {
    FrameInWork work{.image = image, .tracked = tracker_.next(image)};
    if (!work.tracked) return std::nullopt;
    starts_ = starts_ || work.tracked->starts;
    prepare_frames(preparation_, model_.config(), {&work, 1}, false);
    if (!work.tracked) return std::nullopt;
    const bool starts = std::exchange(starts_, false);
    if (seen_ == 0) expression_.know({&work, 1});
    expression_.see({&work, 1});
    const Tensor& expression = work.frame.change;
    constexpr double newest = 0.6;
    smooth_ = starts || !smooth_.defined() ? expression : between(smooth_, expression, newest);
    constexpr std::int64_t frames_at_rest = 10;
    const Pose& pose = work.frame.pose;
    ++seen_;
    if (seen_ == 1) {
        rest_ = expression;
        first_yaw_ = pose.yaw;
        first_pitch_ = pose.pitch;
        first_roll_ = work.frame.roll;
    } else if (seen_ <= frames_at_rest) {
        rest_ = between(rest_, expression, 1.0 / static_cast<double>(seen_));
    }
    const Variable change = Variable(smooth_) - Variable(rest_);
    return Sight{change.value(), pose.yaw - first_yaw_, pose.pitch - first_pitch_,
                 work.frame.roll - first_roll_};
}

}  // namespace stymo
