#include "fit/photo/preparation_overlay.h"

#include "core/io/image.h"
#include "core/ops/elementwise.h"
#include "fit/morphable/mesh_overlay.h"
#include "fit/photo/photo_overlay.h"

namespace stymo {

Tensor preparation_overlay(const PhotoWithFindings& photo, const MorphableHead& head,
                           const Intrinsics& intrinsics, std::int64_t side) {
    const int pixels = static_cast<int>(side);
    const auto resized = [&](const Tensor& image) {
        return clamp(resize_image(image, pixels, pixels), 0.0, 1.0).value();
    };
    const double scale = static_cast<double>(side) / static_cast<double>(photo.image.shape(0));
    constexpr double pivot_depth = 0.9;
    Tensor image = with_fitted_head(resized(photo.image), head, photo.fit, intrinsics);
    image = with_mask_outline(image, resized(photo.mask));
    image = with_landmarks(image, scaled_landmarks(photo.landmarks, scale));
    return with_head_axes(image, camera_from_pose(photo.fit.pose, intrinsics), pivot_depth);
}

}  // namespace stymo
