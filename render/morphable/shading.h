#pragma once

#include <span>

#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// The colours (V, 3) that a camera sees a head's vertices in: albedo times the irradiance
/// (spherical_harmonics.h, 27 numbers) at their normals, clipped to [0.01, 1]. Throws ShapeError
/// for a light of another size.
[[nodiscard]] Tensor shaded_colors(const Tensor& albedo, const Tensor& normals,
                                   std::span<const float> light, const Camera& camera);

}  // namespace stymo
