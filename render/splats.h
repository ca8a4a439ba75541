#pragma once

#include <cstdint>

#include "core/tensor.h"
#include "render/rasterizer.h"
#include "render/texture.h"

namespace stymo {

/// N Gaussians, as renderers of 3D Gaussian splatting (Kerbl et al. 2023) draw them. Here each is
/// round within a plane and thin along its normal. All tensors are float32.
struct Splats {
    Tensor centers;  ///< (N, 3), world coordinates
    Tensor normals;  ///< (N, 3), of unit length
    Tensor sizes;    ///< (N, 1): logarithms of the standard deviations within the planes
    Tensor logits;   ///< (N, 1) of the opacities
    /// (N, 12): factors of 1, y, z, x of the direction of view, each for RGB. A colour is 0.5 plus
    /// their sum with the constants and signs of spherical harmonics that Kerbl et al. have.
    Tensor colors;
};
/// Standard deviation along the normal as a share of that within the plane.
inline constexpr float splat_thickness = 0.3F;

/// Draws splats front to back by the depths of their centres: `color` and `coverage` of the image,
/// nothing else. Each is projected to first order (Zwicker et al. 2001) and widened by a variance
/// of 0.3 square pixels, as viewers do. What covers less than 1 / 255 of a pixel is left out.
[[nodiscard]] RasterImage rendered_splats(const Splats& splats, const Camera& camera,
                                          std::int64_t side);

struct SplatLoss {
    double value = 0.0;
    Splats gradient;  ///< without normals
};
/// The squared differences of a square view, summed over its pixels: those of the colours on black,
/// and 0.3 times those of the coverage and the mask. In the gradient neither the shape of a
/// projected splat nor the direction from which its colour is seen depends on its centre.
[[nodiscard]] SplatLoss splat_loss(const Splats& splats, const TextureView& view);

}  // namespace stymo
