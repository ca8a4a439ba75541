#include "nn/realtime/pixel_depth.h"

#include <limits>

#include "core/error.h"

namespace stymo {
namespace {

/// Without the share of the background in the depth of a ray.
float depth_of_surface(double depth, double opacity, double background) {
    if (opacity < 0.5) return std::numeric_limits<float>::infinity();
    return static_cast<float>((depth - (1.0 - opacity) * background) / opacity);
}

}  // namespace

Tensor pixel_depth(FaceRenderer& renderer, const Camera& camera, std::int64_t rays_per_side,
                   std::int64_t side) {
    if (rays_per_side < 1 || side < rays_per_side || side % rays_per_side != 0)
        fail<ValueError>("[pixel_depth] ", side, " pixels are no multiple of ", rays_per_side,
                         " rays");
    const std::int64_t step = side / rays_per_side;
    Tensor result({side, side, 1});
    const std::span<float> pixels = result.mutable_values<float>();
    // The ray in the middle of `step` pixels goes through pixel k of them if the principal point
    // moves the other way.
    const auto shift = [&](std::int64_t k) {
        return (0.5 - (static_cast<double>(k) + 0.5) / static_cast<double>(step)) /
               static_cast<double>(rays_per_side);
    };
    for (std::int64_t offset = 0; offset < step * step; ++offset) {
        const std::int64_t first_row = offset / step, first_column = offset % step;
        Camera shifted = camera;
        shifted.intrinsics.center_x += shift(first_column);
        shifted.intrinsics.center_y += shift(first_row);
        const View seen = *renderer.render(shifted, {}, FrameParts::field);
        const std::span<const float> depths = seen.depth.values<float>();
        const std::span<const float> opacities = seen.opacity.values<float>();
        for (std::int64_t ray = 0; ray < rays_per_side * rays_per_side; ++ray) {
            const std::int64_t row = ray / rays_per_side * step + first_row;
            const std::int64_t column = ray % rays_per_side * step + first_column;
            const auto index = static_cast<std::size_t>(ray);
            pixels[static_cast<std::size_t>(row * side + column)] =
                depth_of_surface(depths[index], opacities[index], seen.background_depth);
        }
    }
    return result;
}

}  // namespace stymo
