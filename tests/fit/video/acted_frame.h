#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/rng.h"
#include "core/tensor.h"
#include "fit/photo/landmarks.h"
#include "render/morphable/builtin_head.h"
#include "train/data/synthetic_faces.h"

/// Frames of films in which rendered heads do what is known.
namespace video_tests {

constexpr std::int64_t frame_height = 288, frame_width = 640, head_side = 256;

struct Act {
    double yaw = 0.0;  ///< radians
    float jaw = 0.0F, lids = 0.0F;
    std::int64_t left = 0;  ///< of the head's square in the frame
};

inline stymo::Tensor empty_frame(double grey) {
    return stymo::Tensor::full({frame_height, frame_width, 3}, grey);
}

/// Draws head number `seed` into the frame and returns its landmarks.
inline stymo::Landmarks draw(stymo::Tensor& frame, std::uint64_t seed, const Act& act) {
    const stymo::MorphableHead& head = stymo::builtin_head();
    stymo::SyntheticFace face = stymo::sample_synthetic_face(head, stymo::Rng(seed));
    face.pose = stymo::orbit_pose(act.yaw, 0.0, 0.0, 5.3);
    std::ranges::fill(face.expression, 0.0F);
    face.expression[0] = act.jaw;
    face.expression[1] = face.expression[2] = act.lids;
    const stymo::SyntheticImage image = render_synthetic_face(head, face, {}, head_side);
    const auto color = image.color.values<float>(), mask = image.mask.values<float>();
    const auto to = frame.mutable_values<float>();
    constexpr std::int64_t top = (frame_height - head_side) / 2;
    for (std::int64_t i = 0; i < head_side * head_side; ++i) {
        if (mask[static_cast<std::size_t>(i)] < 0.5F) continue;
        const std::int64_t pixel = (top + i / head_side) * frame_width + act.left + i % head_side;
        std::copy_n(color.begin() + 3 * i, 3, to.begin() + 3 * pixel);
    }
    stymo::Landmarks landmarks = image.landmarks;
    for (Eigen::Vector2d& point : landmarks)
        point += Eigen::Vector2d(static_cast<double>(act.left), static_cast<double>(top));
    return landmarks;
}

/// A forearm of the colour of skin, whose left edge is `left`.
inline void draw_arm(stymo::Tensor& frame, std::int64_t left) {
    const auto to = frame.mutable_values<float>();
    for (std::int64_t row = frame_height / 3; row < frame_height; ++row)
        for (std::int64_t column = left; column < left + 70; ++column)
            for (std::int64_t c = 0; c < 3; ++c)
                to[static_cast<std::size_t>(3 * (row * frame_width + column) + c)] =
                    0.8F - 0.15F * static_cast<float>(c);
}

inline bool is_covered(int index) {
    return index >= 14 && index < 18;
}
/// Frame `index` of 32: the head goes to the right, turns to both sides and speaks, blinks twice,
/// and an arm passes before it where it is covered.
inline stymo::Landmarks draw_scene(stymo::Tensor& frame, int index) {
    const double phase = 2.0 * std::numbers::pi * index / 32.0;
    const stymo::Landmarks landmarks = draw(frame, 1,
                                            {.yaw = 0.4 * std::sin(phase),
                                             .jaw = static_cast<float>(1.0 - std::cos(3.0 * phase)),
                                             .lids = index % 12 == 6 ? 2.0F : 0.0F,
                                             .left = 60 + 4 * index});
    if (is_covered(index)) draw_arm(frame, 150 + 50 * (index - 14));
    return landmarks;
}

}  // namespace video_tests
