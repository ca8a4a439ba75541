#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/tensor.h"
#include "render/camera.h"
#include "render/rasterizer.h"

namespace stymo {

/// Teeth or hair that follow the skin: a vertex moves with the mean of its A anchors.
struct TexturedPart {
    std::int64_t owner = 0;  ///< the head for which it was made
    Tensor vertices;         ///< (P, 3)
    std::vector<std::array<std::int32_t, 3>> triangles;
    Tensor uv;                          ///< (P, 2)
    Tensor texture;                     ///< (S, S, 4), 0 to 255; alpha is last
    std::vector<std::int32_t> anchors;  ///< (P, A) vertices of the skin
};

/// Textured scans of N heads that share V vertices of the skin, eyes among them.
struct TexturedHeads {
    std::string name;  ///< of the file, for messages
    Tensor vertices;   ///< (N, V, 3), y up, z out of the face, in any unit
    std::vector<std::array<std::int32_t, 3>> triangles;  ///< counter-clockwise seen from outside
    Tensor uv;                                           ///< (V, 2) in [0, 1], v downwards
    /// V vertices: the first of those that are one point of the surface, where the texture has a
    /// seam. They share a normal.
    std::vector<std::int32_t> welded;
    Tensor head;  ///< (V), from 0 on neck and clothes to 1 on the head, which begins at 0.5
    std::array<std::int32_t, 68> landmarks{};
    Tensor expressions;                         ///< (E, V, 3), one-sided, at full strength
    std::vector<std::string> expression_names;  ///< those of one side begin with L or R
    Tensor textures;                            ///< (N, S, S, 3), 0 to 255
    std::vector<TexturedPart> teeth;            ///< everybody has all of them
    std::vector<TexturedPart> hair;             ///< everybody has at most one of them
};

/// Reads a .safetensors file with the tensors "vertices", "triangles", "uv", "welded", "head",
/// "landmarks68", "expressions", "textures", the metadata "expressions" (names, separated by
/// spaces), and for each part "teeth.K." or "hair.K.", K = 0, 1, ..., before "owner" (1),
/// "vertices", "triangles", "uv", "texture", "anchors". scripts/textured_heads.py writes such a
/// file. Throws FileError, which names the file and the tensor, for tensors that are missing, have
/// other shapes, are not finite or refer to what is not there.
[[nodiscard]] TexturedHeads read_textured_heads(const std::filesystem::path& path);

/// A mix of heads. Mixed colours are multiplied by the tints.
struct TexturedPerson {
    std::vector<float> weights;  ///< N, of sum 1
    std::int64_t hair = -1;      ///< -1: none but what is painted on the skin
    Eigen::Vector3f skin_tint = Eigen::Vector3f::Ones();
    Eigen::Vector3f hair_tint = Eigen::Vector3f::Ones();
};

/// Triangles with one texture.
struct TexturedLayer {
    std::int32_t first_triangle = 0;
    Tensor texture;  ///< (S, S, 3 or 4), 0 to 255
    Eigen::Vector3f tint = Eigen::Vector3f::Ones();
};

/// The surface of one person with one expression, in the frame of render/camera.h.
struct TexturedSurface {
    Tensor vertices;  ///< (M, 3): the skin, then the parts
    Tensor normals;   ///< (M, 3)
    Tensor uv;        ///< (M, 2)
    Tensor head;      ///< (M), as in TexturedHeads
    std::vector<std::array<std::int32_t, 3>> triangles;
    std::vector<TexturedLayer> layers;
    std::array<Eigen::Vector3d, 68> landmarks;
};

/// The mean of the heads with the person's weights, plus the expressions with theirs (E). The eyes
/// and the mouth of the face at rest are at the positions of the built-in head. Throws ShapeError
/// for other numbers of weights, ValueError for hair that is not there.
[[nodiscard]] TexturedSurface textured_surface(const TexturedHeads& heads,
                                               const TexturedPerson& person,
                                               std::span<const float> expression);

/// Draws the surface with the texture (bilinear, 3 x 3 samples a pixel) times the irradiance of
/// `light` at the normals, clipped to [0, 1]. Texels with alpha below a half are transparent. The
/// seven channels of the result's `color` are the colour of everything, the colour of the head
/// alone, which neck and clothes may hide, both premultiplied, and the soft mask of the head.
[[nodiscard]] RasterImage render_textured(const TexturedSurface& surface,
                                          std::span<const float> light, const Camera& camera,
                                          std::int64_t side);

}  // namespace stymo
