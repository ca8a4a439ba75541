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

/// Renders random heads of a linear model with their landmarks: any identity and expression, yaw
/// within 50 degrees, any light, painted skin (face_paint.h), some hair, neck and glasses.
class HeadPictures {
public:
    static constexpr std::int64_t side = 144;

    explicit HeadPictures(const MorphableHead& head);

    /// A face of about 70 pixels, (144, 144, 4). Points of the jaw behind the cheek are at the
    /// cheek's outline, as people mark them.
    [[nodiscard]] LandmarkExample draw(Rng rng) const;

private:
    [[nodiscard]] std::vector<float> expression(Rng& rng) const;
    void move_jaw_to_outline(FacePoints& points, const Camera& camera,
                             std::span<const float> vertices) const;

    const MorphableHead& head_;
    FacePaint paint_;
    /// The expression that is this one's mirror image, or itself.
    std::array<std::size_t, MorphableHead::expression_size> mirrored_{};
    std::vector<std::size_t> smiles_;  ///< expressions that raise a corner of the mouth
    std::vector<std::size_t> teeth_;   ///< that part the lips
    std::vector<std::size_t> blinks_;  ///< that close an eye
    std::vector<bool> used_;           ///< that move the face at all
    /// For each point of the jaw, vertices at its height that may be the outline.
    std::array<std::vector<std::int32_t>, 17> outline_;
};

}  // namespace stymo
