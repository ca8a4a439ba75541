#include "render/morphable/head.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"

namespace stymo {

namespace {

/// result += sum_k code[k] basis[k]
void accumulate(Tensor& result, const Tensor& basis, std::span<const float> code, const char* name) {
    if (static_cast<std::int64_t>(code.size()) != basis.shape(0)) {
        fail<ShapeError>("[morphable head] the ", name, " code has ", code.size(), " numbers, the model ", basis.shape(0));
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

Tensor head_vertices(const MorphableHead& head, std::span<const float> identity_code, std::span<const float> expression_code) {
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

Tensor vertex_normals(const Tensor& vertices, std::span<const std::array<std::int32_t, 3>> triangles) {
    Tensor normals = Tensor::zeros(vertices.shape());
    const auto points = vertices.values<float>();
    const auto sums = normals.mutable_values<float>();
    const auto point = [&](std::int32_t vertex) { return points.subspan(3 * static_cast<std::size_t>(vertex), 3); };
    for (const auto& [a, b, c] : triangles) {
        std::array<float, 3> u{};
        std::array<float, 3> v{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            u[axis] = point(b)[axis] - point(a)[axis];
            v[axis] = point(c)[axis] - point(a)[axis];
        }
        for (const std::int32_t vertex : {a, b, c}) {
            const auto sum = sums.subspan(3 * static_cast<std::size_t>(vertex), 3);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const std::size_t next = (axis + 1) % 3;
                const std::size_t last = (axis + 2) % 3;
                sum[axis] += u[next] * v[last] - u[last] * v[next];
            }
        }
    }
    for (std::size_t vertex = 0; vertex < sums.size(); vertex += 3) {
        const float length = std::hypot(sums[vertex], sums[vertex + 1], sums[vertex + 2]);
        if (length > 0.0F) {
            for (std::size_t axis = 0; axis < 3; ++axis) sums[vertex + axis] /= length;
        }
    }
    return normals;
}

}  // namespace stymo
