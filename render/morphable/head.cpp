#include "render/morphable/head.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {

namespace {

/// result += sum_k code[k] basis[k]
void accumulate(Tensor& result, const Tensor& basis, std::span<const float> code,
                const char* name) {
    if (static_cast<std::int64_t>(code.size()) != basis.shape(0)) {
        fail<ShapeError>("[morphable head] the ", name, " code has ", code.size(),
                         " numbers, the model ", basis.shape(0));
    }
    const auto values = basis.values<float>();
    const auto target = result.mutable_values<float>();
    parallel_for(result.size(), 4096, [&](std::int64_t begin, std::int64_t end) {
        for (std::size_t k = 0; k < code.size(); ++k) {
            const std::size_t row = k * target.size();
            for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
                target[i] += code[k] * values[row + i];
        }
    });
}

}  // namespace

Tensor head_vertices(const MorphableHead& head, std::span<const float> identity_code,
                     std::span<const float> expression_code) {
    Tensor vertices = head.mean;
    accumulate(vertices, head.identity, identity_code, "identity");
    accumulate(vertices, head.expression, expression_code, "expression");
    return vertices;
}

Tensor head_albedo(const MorphableHead& head, std::span<const float> texture_code) {
    Tensor albedo = head.mean_albedo;
    accumulate(albedo, head.albedo, texture_code, "texture");
    for (float& value : albedo.mutable_values<float>()) value = std::clamp(value, 0.02F, 1.0F);
    return albedo;
}

Tensor vertex_normals(const Tensor& vertices,
                      std::span<const std::array<std::int32_t, 3>> triangles) {
    Tensor normals = Tensor::zeros(vertices.shape());
    const Eigen::Map<const Eigen::Matrix3Xf> points(vertices.values<float>().data(), 3,
                                                    vertices.shape(0));
    Eigen::Map<Eigen::Matrix3Xf> sums(normals.mutable_values<float>().data(), 3, points.cols());
    for (const auto& [a, b, c] : triangles) {
        const Eigen::Vector3f u = points.col(b) - points.col(a);
        const Eigen::Vector3f v = points.col(c) - points.col(a);
        const Eigen::Vector3f normal = u.cross(v);
        for (const std::int32_t vertex : {a, b, c}) sums.col(vertex) += normal;
    }
    for (Eigen::Index vertex = 0; vertex < sums.cols(); ++vertex)
        sums.col(vertex).stableNormalize();
    return normals;
}

}  // namespace stymo
