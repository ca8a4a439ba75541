#include "train/landmarks/portrait_parts.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "train/landmarks/face_paint.h"
#include "train/landmarks/random.h"

namespace stymo {
namespace {

/// Axes of the face in the image, in units of the distance of the outer corners of the eyes; the
/// origin is between them.
struct FaceFrame {
    Eigen::Vector2d origin;
    Eigen::Vector2d right;
    Eigen::Vector2d down;

    explicit FaceFrame(const FacePoints& points)
        : origin(0.5 * (points[36] + points[45])), right(points[45] - points[36]) {
        // A turned face is narrower, but as high.
        const double height = (points[8] - origin).norm() / 1.25;
        const double unit = std::max(right.norm(), height);
        right = unit * right.normalized();
        down = {-right.y(), right.x()};
    }
    [[nodiscard]] Eigen::Vector2d coordinates(const Eigen::Vector2d& pixel) const {
        const Eigen::Vector2d offset = (pixel - origin) / right.squaredNorm();
        return {offset.dot(right), offset.dot(down)};
    }
};

class Canvas {
public:
    explicit Canvas(LandmarkExample& example)
        : width_(example.image.shape(1)),
          values_(example.image.mutable_values<float>()),
          frame_(example.points) {}

    [[nodiscard]] const FaceFrame& frame() const { return frame_; }

    /// `look(x, y)` in the face's frame gives a colour and a coverage.
    template <class Look>
    void draw(bool behind, const Look& look) {
        for (std::size_t at = 0; at < values_.size(); at += 4) {
            float* pixel = &values_[at];
            if (behind && pixel[3] >= 0.999F) continue;
            const auto index = static_cast<std::int64_t>(at / 4);
            const Eigen::Vector2d place =
                frame_.coordinates({static_cast<double>(index % width_) + 0.5,
                                    static_cast<double>(index / width_) + 0.5});
            const auto [color, coverage] = look(place.x(), place.y());
            if (coverage <= 0.0) continue;
            const auto share = static_cast<float>(coverage);
            const float there = pixel[3];
            for (int k = 0; k < 3; ++k) {
                const auto value = static_cast<float>(std::clamp(color[k], 0.0, 1.0));
                pixel[k] = behind ? pixel[k] + (1.0F - there) * share * value
                                  : pixel[k] + share * (value - pixel[k]);
            }
            pixel[3] = there + (1.0F - there) * share;
        }
    }

private:
    std::int64_t width_;
    std::span<float> values_;
    FaceFrame frame_;
};

struct Paint {
    Eigen::Vector3d color;
    double coverage;
};

/// Brightness along strands that run downwards.
class Strands {
public:
    explicit Strands(Rng& rng)
        : frequency_(between(rng, 10.0, 40.0)),
          phase_(between(rng, 0.0, 6.0)),
          slant_(between(rng, -0.6, 0.6)),
          depth_(between(rng, 0.05, 0.35)) {}
    [[nodiscard]] double at(double x, double y) const {
        const double t = x + slant_ * y + 0.1 * std::sin(3.0 * y + phase_);
        return 1.0 + depth_ * std::sin(frequency_ * t + phase_) *
                         std::sin(0.37 * frequency_ * t + 2.0 * phase_);
    }

private:
    double frequency_, phase_, slant_, depth_;
};

void draw_hair(Canvas& canvas, Rng& rng) {
    const Eigen::Vector3d hair = FacePaint::hair_color(rng);
    const Strands strands(rng);
    const double half_width = between(rng, 0.85, 1.25), top = between(rng, 1.05, 1.5);
    const double length = chance(rng, 0.5) ? between(rng, 0.2, 0.7) : between(rng, 0.8, 2.2);
    const double flare = between(rng, -0.1, 0.25);
    const auto outside = [=](double x, double y) {
        const double width = half_width + flare * std::clamp(y, 0.0, 2.0);
        return y < 0.0 ? std::hypot(x / width, y / top) : std::abs(x) / width;
    };
    canvas.draw(true, [&](double x, double y) {
        return Paint{hair * strands.at(x, y) * 0.9,
                     ramp(1.03, 0.97, outside(x, y)) * ramp(length + 0.1, length - 0.1, y)};
    });
    if (!chance(rng, 0.55)) return;
    // Curtains over the sides of the face and a fringe.
    const double sides = between(rng, 0.72, 0.95), lean = between(rng, -0.25, 0.25);
    const double fringe = chance(rng, 0.35) ? between(rng, 0.25, 0.55) : between(rng, 0.6, 1.0);
    const double part = between(rng, -0.6, 0.6), slope = between(rng, -0.3, 0.6);
    canvas.draw(false, [&](double x, double y) {
        const double curtain = ramp(sides - 0.05, sides + 0.05, std::abs(x - lean * 0.3));
        const double over =
            ramp(-fringe + 0.05, -fringe - 0.05, y + slope * std::abs(x - part) * -0.5);
        const double inside = ramp(1.03, 0.97, outside(x, y)) * ramp(length + 0.1, length - 0.1, y);
        return Paint{hair * strands.at(x, y), inside * std::max(curtain, over)};
    });
}

void draw_shoulders(Canvas& canvas, const Eigen::Vector3d& skin, Rng& rng) {
    const double neck = between(rng, 0.45, 0.65), shade = between(rng, 0.5, 0.9);
    const double collar = between(rng, 1.5, 2.0), slope = between(rng, 0.2, 0.5);
    const double lean = between(rng, -0.2, 0.2);
    const Eigen::Vector3d cloth(rng.uniform() * rng.uniform(), rng.uniform() * rng.uniform(),
                                rng.uniform() * rng.uniform());
    const Eigen::Vector3d shirt = between(rng, 0.4, 1.0) * Eigen::Vector3d(0.95, 0.97, 1.0);
    const double opening = between(rng, 0.1, 0.9);
    canvas.draw(true, [&](double x, double y) {
        x -= lean * y;
        const double clothes = ramp(0.0, 0.06, y - collar - slope * (std::abs(x) - neck));
        if (y > 1.2 && clothes > 0.5)
            return Paint{std::abs(x) < opening * (3.2 - y) * 0.5 ? shirt : cloth, clothes};
        return Paint{shade * skin, y > 0.3 ? ramp(neck + 0.04, neck - 0.04, std::abs(x)) : 0.0};
    });
}

void draw_glasses(Canvas& canvas, const FacePoints& points, Rng& rng) {
    const Eigen::Vector3d color = chance(rng, 0.7)
                                      ? between(rng, 0.02, 0.25) * Eigen::Vector3d(1.0, 0.8, 0.7)
                                      : between(rng, 0.4, 0.8) * Eigen::Vector3d(1.0, 0.95, 0.8);
    const double thickness = between(rng, 0.012, 0.045), opacity = between(rng, 0.5, 1.0);
    const double half_width = between(rng, 0.21, 0.27), half_height = between(rng, 0.12, 0.22);
    const double power = between(rng, 2.0, 5.0), drop = between(rng, 0.0, 0.08);
    const double glare = chance(rng, 0.3) ? between(rng, 0.0, 0.35) : between(rng, 0.0, 0.08);
    const FaceFrame& frame = canvas.frame();
    const std::array<Eigen::Vector2d, 2> eyes{frame.coordinates(0.5 * (points[36] + points[39])),
                                              frame.coordinates(0.5 * (points[42] + points[45]))};
    const double narrow = std::clamp((eyes[1] - eyes[0]).norm() / 0.63, 0.6, 1.0);
    canvas.draw(false, [&](double x, double y) {
        double coverage = 0.0, shine = 0.0;
        for (std::size_t k = 0; k < 2; ++k) {
            const double u = std::abs(x - eyes[k].x()) / (half_width * narrow);
            const double v = std::abs(y - eyes[k].y() - drop) / half_height;
            const double r = std::pow(std::pow(u, power) + std::pow(v, power), 1.0 / power);
            const double distance = std::abs(r - 1.0) * half_height;
            coverage = std::max(coverage, ramp(thickness, 0.5 * thickness, distance));
            if (r < 1.0) shine = glare * ramp(0.3, 0.0, std::abs(x + y - eyes[k].x()));
        }
        const bool bridge =
            x > eyes[0].x() + half_width * narrow && x < eyes[1].x() - half_width * narrow;
        const bool temple =
            x < eyes[0].x() - half_width * narrow || x > eyes[1].x() + half_width * narrow;
        if (bridge || (temple && std::abs(x) < 0.68))
            coverage = std::max(
                coverage, ramp(thickness, 0.4 * thickness, std::abs(y - eyes[0].y() - 0.3 * drop)));
        if (coverage * opacity >= shine) return Paint{color, coverage * opacity};
        return Paint{Eigen::Vector3d::Constant(0.95), shine};
    });
}

}  // namespace

void draw_portrait_parts(LandmarkExample& example, Rng rng) {
    Canvas canvas(example);
    if (chance(rng, 0.8)) draw_shoulders(canvas, FacePaint::skin_color(rng), rng);
    if (chance(rng, 0.7)) draw_hair(canvas, rng);
    if (chance(rng, 0.22)) draw_glasses(canvas, example.points, rng);
}

}  // namespace stymo
