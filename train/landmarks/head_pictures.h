#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/rng.h"
#include "render/camera.h"
#include "render/morphable/head.h"
#include "train/landmarks/face_paint.h"
#include "train/landmarks/landmark_example.h"

namespace stymo {

/// Renders random heads of a linear model with their landmarks: random identity, expression and
/// light, yaw within 50 degrees, painted skin (face_paint.h), and sometimes hair, neck and glasses.
class HeadPictures {
public:
    static constexpr std::int64_t side = 144;

    explicit HeadPictures(const MorphableHead& head);

    /// Draws an image (144, 144, 4) with a face of about 70 pixels. Points of the jaw that the
    /// cheek hides are moved to the cheek's outline, where people mark them.
    [[nodiscard]] LandmarkExample draw(Rng rng) const;

private:
    [[nodiscard]] std::vector<float> expression(Rng& rng) const;
    void move_jaw_to_outline(FacePoints& points, const Camera& camera,
                             std::span<const float> vertices) const;

    const MorphableHead& head_;
    FacePaint paint_;
    /// For each expression, the index of its mirror image, or of itself.
    std::array<std::size_t, MorphableHead::expression_size> mirrored_{};
    std::vector<std::size_t> smiles_;  ///< expressions that raise a corner of the mouth
    std::vector<std::size_t> teeth_;   ///< expressions that part the lips
    std::vector<std::size_t> blinks_;  ///< expressions that close an eye
    std::vector<bool> used_;           ///< whether an expression moves the face
    /// For each point of the jaw, vertices at its height that may be the outline.
    std::array<std::vector<std::int32_t>, 17> outline_;
};

}  // namespace stymo
