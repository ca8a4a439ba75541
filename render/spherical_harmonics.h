#pragma once

#include <array>
#include <span>

#include "core/tensor.h"
#include "render/camera.h"

namespace stymo {

/// Real spherical harmonics up to band 2 at a unit normal in camera space (x right, y down, z
/// forward), times the weights of the Lambertian reflection kernel, with the signs and the order
/// that 3D morphable face models commonly use.
[[nodiscard]] std::array<double, 9> spherical_harmonics(const Eigen::Vector3d& normal);

/// Irradiance in RGB: sum_k light[3 k + channel] Y_k(normal). `light` holds 27 coefficients, three
/// colours for each of nine functions. Throws ShapeError for another number.
[[nodiscard]] Eigen::Vector3d irradiance(std::span<const float> light,
                                         const Eigen::Vector3d& normal);

/// The white ambient light: 0.8 in the constant function, 0 elsewhere.
[[nodiscard]] std::array<float, 27> neutral_light();

/// Shaded colours (V, 3) of a head's vertices for a camera: albedo times the irradiance
/// (spherical_harmonics.h) at the normals, clipped to [0.01, 1]. `light` has 27 numbers. Throws
/// ShapeError for a light of another size.
[[nodiscard]] Tensor shaded_colors(const Tensor& albedo, const Tensor& normals,
                                   std::span<const float> light, const Camera& camera);

}  // namespace stymo
