#include "fit/video/face_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/io/image.h"

namespace stymo {

namespace {

/// Distance between the outermost points of the jaw and between brows and chin, whichever is more.
double extent_of(const Landmarks& face) {
    return std::max((face[16] - face[0]).norm(), (face[8] - mean_landmark(face, 17, 26)).norm());
}

Eigen::Vector2d center_of(const Landmarks& face) {
    return mean_landmark(face, 17, 67);
}

/// The face of the same size that is nearest to where it was.
std::optional<Landmarks> nearest(const std::vector<DetectedFace>& faces, const Landmarks& last,
                                 const Eigen::Vector2d& offset, double scale, double reach) {
    constexpr double largest_growth = 1.6;
    const double extent = extent_of(last);
    double best = reach * extent;
    std::optional<Landmarks> result;
    for (const DetectedFace& face : faces) {
        Landmarks points = scaled_landmarks(face.landmarks, 1.0 / scale);
        for (Eigen::Vector2d& point : points) point += offset;
        const double distance = (center_of(points) - center_of(last)).norm();
        const double growth = extent_of(points) / extent;
        if (!(distance < best) || growth > largest_growth || growth < 1.0 / largest_growth)
            continue;
        best = distance;
        result = points;
    }
    return result;
}

}  // namespace

bool FaceTracker::is_cut(const Tensor& frame) {
    constexpr int side = 24;
    // Frames of a shot differ less, unless much moves: then they did so before.
    constexpr double least_change = 0.06, more_than_usual = 5.0, memory = 0.8;
    const Tensor small = resize_image(frame, side, side);
    const auto values = small.values<float>();
    double change = 0.0;
    for (std::size_t i = 0; i < thumbnail_.size(); ++i)
        change += std::abs(values[i] - thumbnail_[i]);
    change /= static_cast<double>(values.size());
    const bool first = thumbnail_.empty();
    thumbnail_.assign(values.begin(), values.end());
    const bool cut = !first && change > std::max(least_change, more_than_usual * usual_change_);
    if (!cut) usual_change_ = memory * usual_change_ + (1.0 - memory) * change;
    return cut;
}

std::optional<Landmarks> FaceTracker::find(const Tensor& frame) const {
    if (last_ && gone_ == 0) {
        // The surroundings of the face, in which it is about as wide as the detector likes.
        constexpr double wanted_extent = 130.0, margin = 0.9;
        const double extent = extent_of(*last_);
        const Eigen::Vector2d center = center_of(*last_);
        const auto bound = [](double value, std::int64_t length) {
            return std::clamp<std::int64_t>(std::llround(value), 0, length);
        };
        const double reach = (0.5 + margin) * extent;
        const std::int64_t left = bound(center.x() - reach, frame.shape(1) - 1),
                           top = bound(center.y() - reach, frame.shape(0) - 1);
        const std::int64_t right = std::max(bound(center.x() + reach, frame.shape(1)), left + 1),
                           bottom = std::max(bound(center.y() + reach, frame.shape(0)), top + 1);
        const double scale = wanted_extent / extent;
        const Tensor part = image_part(frame, top, left, bottom - top, right - left);
        const auto length = [scale](std::int64_t pixels) {
            return std::max(1, static_cast<int>(std::lround(scale * static_cast<double>(pixels))));
        };
        const Tensor scaled = resize_image(part, length(bottom - top), length(right - left));
        constexpr double reach_in_a_frame = 0.5;
        return nearest(detector_.find(scaled, FaceSearch::doubtful), *last_,
                       {static_cast<double>(left), static_cast<double>(top)}, scale,
                       reach_in_a_frame);
    }
    const std::vector<DetectedFace> faces = detector_.find(frame, FaceSearch::clear);
    // Somebody else who is seen beside it does not become the followed face, unless it stays away.
    constexpr double seconds_of_patience = 2.0;
    if (last_ && static_cast<double>(gone_) < seconds_of_patience * rate_) {
        constexpr double reach = 1.0;
        return nearest(faces, *last_, Eigen::Vector2d::Zero(), 1.0, reach);
    }
    if (faces.empty()) return std::nullopt;
    return faces.front().landmarks;
}

Landmarks FaceTracker::smoothed(const Landmarks& found, bool starts) {
    const double unit = extent_of(found), seconds = static_cast<double>(frames_) / rate_;
    Landmarks smooth;
    for (std::size_t i = 0; i < found.size(); ++i) {
        if (starts) filters_[i].reset();
        smooth[i] = filters_[i](found[i], seconds, unit);
    }
    return smooth;
}

std::optional<TrackedFace> FaceTracker::next(const Tensor& frame) {
    ++frames_;
    const bool cut = is_cut(frame);
    const bool followed = last_ && gone_ == 0;
    if (cut) last_.reset();
    const bool starts = !last_ || gone_ > 0;
    std::optional<Landmarks> found = find(frame);
    // A face that has moved far, or that the close look missed.
    if (!found && last_ && gone_ == 0) {
        ++gone_;
        found = find(frame);
        --gone_;
    }
    if (!found) {
        ++gone_;
        return std::nullopt;
    }
    // A face that leaves or comes back may change the whole picture too.
    if (cut && followed) ++cuts_;
    last_ = found;
    gone_ = 0;
    return TrackedFace{*found, smoothed(*found, starts), starts};
}

}  // namespace stymo
