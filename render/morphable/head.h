#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// The part of the head to which a vertex belongs.
enum class HeadPart : unsigned char { skin, lips, mouth, eyes, brows, ears, hair };

/// A linear 3D morphable head model in the world axes of render/camera.h: x to the image's right, y
/// up, z out of the face, the origin inside the head, one unit about a decimetre. Codes that are
/// standard normal give plausible heads.
struct MorphableHead {
    static constexpr std::int64_t identity_size = 100;
    static constexpr std::int64_t expression_size = 79;
    static constexpr std::int64_t texture_size = 100;

    Tensor mean;                                         ///< (V, 3) float32
    Tensor identity;                                     ///< (100, V, 3)
    Tensor expression;                                   ///< (79, V, 3)
    Tensor mean_albedo;                                  ///< (V, 3), RGB in [0, 1]
    Tensor albedo;                                       ///< (100, V, 3)
    std::vector<std::array<std::int32_t, 3>> triangles;  ///< counter-clockwise seen from outside
    std::array<std::int32_t, 68> landmarks{};  ///< vertices, in the order of dlib's 68 points
    std::vector<HeadPart> parts;               ///< part of each vertex
    /// Expressions that are meaningful only for coefficients >= 0 (a jaw opens, it does not close
    /// further).
    std::array<bool, expression_size> one_sided{};
    /// Names of the first expressions, for example "jawOpen" or "eyeBlink_L" (the person's left);
    /// empty if they are not known.
    std::vector<std::string> expression_names;
    /// (V, 2): position in the grid to which a vertex of the built-in head belongs, from 0 to 1, u
    /// around the head and v downwards; undefined for scans.
    Tensor grid_uv;

    [[nodiscard]] std::int64_t vertex_count() const { return mean.shape(0); }
};

/// mean + sum_k identity_code[k] identity[k] + sum_k expression_code[k] expression[k]: (V, 3).
/// Throws ShapeError for codes of other sizes than 100 and 79.
[[nodiscard]] Tensor head_vertices(const MorphableHead& head, std::span<const float> identity_code,
                                   std::span<const float> expression_code);
/// mean_albedo + sum_k texture_code[k] albedo[k], clipped to [0.02, 1]: (V, 3). Throws ShapeError
/// for another size than 100.
[[nodiscard]] Tensor head_albedo(const MorphableHead& head, std::span<const float> texture_code);
/// Unit normals (V, 3) pointing outwards, weighted by the area of the triangles; zero at vertices
/// without triangles.
[[nodiscard]] Tensor vertex_normals(const Tensor& vertices,
                                    std::span<const std::array<std::int32_t, 3>> triangles);

}  // namespace stymo
