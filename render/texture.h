#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/tensor.h"
#include "render/camera.h"
#include "render/rasterizer.h"

namespace stymo {

/// The texel at (u, v) in [0, 1], v downwards, interpolated and divided by `white`. A texture
/// (height, width, 3 or 4) without alpha is opaque.
[[nodiscard]] Eigen::Array4f texel(const Tensor& texture, float u, float v, float white = 1.0F);

/// A surface with one texture.
struct TexturedMesh {
    Tensor vertices;  ///< (M, 3), world coordinates
    Tensor normals;   ///< (M, 3), of unit length
    Tensor uv;        ///< (M, 2) in [0, 1], v downwards
    std::vector<std::array<std::int32_t, 3>> triangles;
    Tensor texture{};  ///< (S, S, 3) in [0, 1]
};

/// A picture of the surface.
struct TextureView {
    Camera camera;
    Tensor image;  ///< (R, R, 3) in [0, 1]
    Tensor mask;   ///< (R, R, 1), 1 where the picture shows the surface
};

/// Colours (V, 3) of vertices and the weights of the pictures that show them (V, 4), 0 to 1, by the
/// rule of baked_texture; colours of weight 0 are black.
[[nodiscard]] Tensor seen_colors(const Tensor& vertices, const Tensor& normals,
                                 std::span<const std::array<std::int32_t, 3>> triangles,
                                 std::span<const TextureView> views);

/// The texture (side, side, 3) of a mesh that pictures show. A texel is the mean of the pictures in
/// which its point is visible, weighted by the fourth power of the cosine between its normal and
/// the direction of view, because slanted surfaces are blurred, and by the mask. `guess` (M, 4) are
/// colours for what no picture shows and their small weights: a weight of 0.01 is enough. Texels
/// without any weight continue those around them. Throws ValueError if the side is no power of two,
/// and what `rasterize` throws.
[[nodiscard]] Tensor baked_texture(const TexturedMesh& mesh, std::span<const TextureView> views,
                                   const Tensor& guess, std::int64_t side);

/// The mesh with its texture, without light, seen by a camera.
[[nodiscard]] RasterImage rendered_mesh(const TexturedMesh& mesh, const Camera& camera,
                                        const RasterSettings& settings);

}  // namespace stymo
