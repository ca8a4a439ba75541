#pragma once

#include <cstdint>

#include "nn/realtime/face_renderer.h"

namespace stymo {

/// The depth of each pixel of an image, (side, side, 1): the mean Euclidean distance from the
/// camera's centre of what the ray through the pixel's centre meets; infinity if more than half of
/// the light passes. The renderer, made with RendererOptions::depth, has few rays per frame; it
/// renders the field once for each of a pixel's positions among them. Throws ValueError if `side`
/// is no multiple of `rays_per_side`, that of the renderer's images (Decoder::rays_per_side).
[[nodiscard]] Tensor pixel_depth(FaceRenderer& renderer, const Camera& camera,
                                 std::int64_t rays_per_side, std::int64_t side);

}  // namespace stymo
