#pragma once

#include <span>

#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// Shaded colours (V, 3) of a head's vertices for a camera: albedo times the irradiance
/// (spherical_harmonics.h) at the normals, clipped to [0.01, 1]. `light` has 27 numbers. Throws
/// ShapeError for a light of another size.
[[nodiscard]] Tensor shaded_colors(const Tensor& albedo, const Tensor& normals,
                                   std::span<const float> light, const Camera& camera);

}  // namespace stymo
