#include "train/head_mask_variation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace stymo {
namespace {

constexpr ImagePoint middle{0.5, 0.5};
/// The face with its forehead in FFHQ's square.
constexpr ImagePoint face_center{0.5, 0.53};
constexpr ImagePoint face_radius{0.27, 0.35};

}  // namespace

void HeadMaskVariation::describe(ConfigSchema& schema) {
    schema.number("variation.background_share", background_share, 0.0, 1.0,
                  "share of the cut-out people that get another background");
    schema.number("variation.hair_share", hair_share, 0.0, 1.0,
                  "share of the photos whose hair is made larger");
    schema.number("variation.hat_share", hat_share, 0.0, 1.0, "share of the photos that get a hat");
    schema.number("variation.glasses_share", glasses_share, 0.0, 1.0,
                  "share of the photos that get glasses");
    schema.number("variation.cover_share", cover_share, 0.0, 1.0,
                  "share of the photos with something in front of the head");
    schema.number("variation.degrees", degrees, 0.0, 180.0, "largest rotation");
    schema.number("variation.scale", scale, 1.0, 4.0, "largest enlargement");
    schema.number("variation.shift", shift, 0.0, 1.0, "largest shift, in units of the side");
    schema.number("variation.color", color, 0.0, 1.0, "strength of the changes of colour");
    schema.number("variation.blur_share", blur_share, 0.0, 1.0,
                  "share of the photos that lose resolution");
}

ImagePlacement::ImagePlacement(double degrees, double scale, double shift, Rng& rng) {
    const double angle = rng.uniform(-degrees, degrees) * std::numbers::pi / 180.0;
    const double shrinking = std::pow(scale, rng.uniform(-1.0, 1.0));
    cosine_ = shrinking * std::cos(angle);
    sine_ = shrinking * std::sin(angle);
    x_ = rng.uniform(-shift, shift);
    y_ = rng.uniform(-shift, shift);
    mirrored_ = rng.uniform() < 0.5;
}

ImagePoint ImagePlacement::source(const ImagePoint& point) const {
    const double u = mirrored_ ? middle[0] - point[0] : point[0] - middle[0];
    const double v = point[1] - middle[1];
    return {middle[0] + x_ + cosine_ * u - sine_ * v, middle[1] + y_ + sine_ * u + cosine_ * v};
}

LargerHair::LargerHair(Rng& rng) : logarithm_(std::log(rng.uniform(1.2, 2.6))) {
    for (std::size_t i = 0; i < waves_.size(); ++i) {
        const double frequency = std::array{1.0, 2.0, 5.0, 11.0}[i];
        waves_[i] = {frequency, rng.uniform(0.0, 2.0 * std::numbers::pi),
                     rng.uniform(0.0, 0.6 / std::sqrt(frequency))};
    }
}

ImagePoint LargerHair::source(const ImagePoint& point) const {
    const double u = (point[0] - face_center[0]) / face_radius[0];
    const double v = (point[1] - face_center[1]) / face_radius[1];
    const double radius = std::hypot(u, v);
    if (radius <= 1.0) return point;
    const double angle = std::atan2(v, u);
    double stretch = 0.5;
    for (const Wave& wave : waves_)
        stretch += wave.height * std::sin(wave.frequency * angle + wave.phase);
    const double factor = std::exp(logarithm_ * std::clamp(stretch, -0.2, 1.0));
    const double scale = (1.0 + (radius - 1.0) / factor) / radius;
    return {face_center[0] + scale * (point[0] - face_center[0]),
            face_center[1] + scale * (point[1] - face_center[1])};
}

Hat::Hat(Rng& rng)
    : x_(rng.uniform(0.46, 0.54)),
      brim_(rng.uniform(0.18, 0.38)),
      tilt_(rng.uniform(-0.25, 0.25)),
      width_(rng.uniform(0.26, 0.38)),
      crown_top_(brim_ - rng.uniform(0.15, 0.45)),
      taper_(rng.uniform(0.5, 1.1)),
      brim_width_(rng.uniform() < 0.4 ? width_ : width_ * rng.uniform(1.0, 2.0)),
      thickness_(rng.uniform(0.01, 0.07)),
      bend_(rng.uniform(-0.5, 0.8)),
      shadow_(rng.uniform(0.0, 0.15)) {}

Hat::Part Hat::part(const ImagePoint& point) const {
    const double u = point[0] - x_;
    const double v = point[1] - brim_ - tilt_ * u + bend_ * (u * u - 0.25 * width_ * width_);
    const double height = brim_ - crown_top_;
    const double up = std::clamp(-v / height, 0.0, 1.0);
    const double half = width_ * (1.0 + (taper_ - 1.0) * up) * std::sqrt(1.0 - up * up * up);
    if (std::abs(v) <= thickness_ && std::abs(u) <= brim_width_) return Part::hat;
    if (v <= 0.0 && -v <= height && std::abs(u) <= half) return Part::hat;
    if (v < 0.0) return Part::outside;
    return v <= thickness_ + shadow_ && std::abs(u) <= brim_width_ ? Part::shadow : Part::none;
}

Glasses::Glasses(Rng& rng)
    : tilt_(rng.uniform(-0.06, 0.06)),
      middle_(rng.uniform(0.48, 0.52)),
      height_(rng.uniform(0.47, 0.51)),
      apart_(rng.uniform(0.12, 0.15)),
      lens_width_(rng.uniform(0.08, 0.13)),
      lens_height_(rng.uniform(0.05, 0.1)),
      roundness_(rng.uniform(2.0, 6.0)),
      rim_(rng.uniform(0.0, 0.18)),
      opacity_(static_cast<float>(rng.uniform() < 0.3 ? 0.15 : rng.uniform(0.6, 1.0))),
      fade_(static_cast<float>(rng.uniform(-0.5, 0.8))) {
    const double light = rng.uniform() < 0.8 ? 0.25 : 0.9;
    const double frame_light = rng.uniform() < 0.7 ? 0.2 : 1.0;
    const double lens_grey = rng.uniform(), frame_grey = rng.uniform();
    for (std::size_t c = 0; c < 3; ++c) {
        lens_[c] = static_cast<float>(light * (0.6 * lens_grey + 0.4 * rng.uniform()));
        frame_[c] = static_cast<float>(frame_light * (0.7 * frame_grey + 0.3 * rng.uniform()));
    }
}

Glasses::Paint Glasses::paint(const ImagePoint& point) const {
    constexpr double temple_thickness = 0.008, ear = 0.36;
    const double x = point[0] - middle_, u = std::abs(x);
    const double v = point[1] - height_ - tilt_ * x;
    const double lens = std::pow(std::abs(u - apart_) / lens_width_, roundness_) +
                        std::pow(std::abs(v) / lens_height_, roundness_);
    if (lens <= 1.0) {
        Paint paint{lens_, opacity_, false};
        const auto lighter = std::max(0.0F, fade_ * static_cast<float>(v / lens_height_));
        for (float& value : paint.color) value += lighter * (0.8F - value);
        return paint;
    }
    if (lens <= std::pow(1.0 + rim_, roundness_)) return {frame_, 1.0F, false};
    const bool in_line = std::abs(v + 0.5 * lens_height_) <= temple_thickness;
    if (in_line && u < apart_) return {frame_, 1.0F, false};
    return {frame_, in_line && u < ear ? 1.0F : 0.0F, true};
}

ColorChange::ColorChange(double strength, Rng& rng)
    : gamma_(static_cast<float>(std::exp(strength * rng.uniform(-1.5, 1.5)))),
      saturation_(rng.uniform() < 0.1
                      ? 0.0F
                      : static_cast<float>(1.0 + strength * rng.uniform(-1.5, 1.0))) {
    const double gain = rng.uniform(-1.0, 1.0);
    for (float& factor : gains_)
        factor = static_cast<float>(std::exp(strength * (gain + 0.4 * rng.uniform(-1.0, 1.0))));
}

std::array<float, 3> ColorChange::operator()(const std::array<float, 3>& color) const {
    const float grey = 0.3F * color[0] + 0.59F * color[1] + 0.11F * color[2];
    std::array<float, 3> changed{};
    for (std::size_t c = 0; c < 3; ++c) {
        const float value = std::clamp(grey + saturation_ * (color[c] - grey), 0.0F, 1.0F);
        changed[c] = std::clamp(gains_[c] * std::pow(value, gamma_), 0.0F, 1.0F);
    }
    return changed;
}

}  // namespace stymo
