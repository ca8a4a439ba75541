#include "render/morphable/builtin_head.h"

#include "render/morphable/displacement.h"
#include "render/morphable/landmarks.h"

namespace stymo {

namespace {

[[nodiscard]] Tensor as_tensor(const std::vector<std::vector<Vector3>>& rows) {
    const auto vertices = static_cast<std::int64_t>(rows.front().size());
    Tensor result({static_cast<std::int64_t>(rows.size()), vertices, 3});
    const auto values = result.mutable_values<float>();
    std::size_t index = 0;
    for (const auto& row : rows) {
        for (const Vector3& vector : row) {
            for (const double value : vector) values[index++] = static_cast<float>(value);
        }
    }
    return result;
}

[[nodiscard]] Tensor as_tensor(const std::vector<Vector3>& row) {
    return as_tensor(std::vector<std::vector<Vector3>>{row}).reshaped({static_cast<std::int64_t>(row.size()), 3});
}

}  // namespace

MorphableHead builtin_head() {
    const morphable::HeadParameters parameters;
    morphable::HeadMesh mesh = morphable::generate_head(parameters);
    MorphableHead head;
    head.mean = as_tensor(mesh.vertices);
    head.mean_albedo = as_tensor(mesh.albedo);
    head.identity = as_tensor(morphable::identity_basis(mesh));
    head.expression = as_tensor(morphable::expression_basis(mesh, head.one_sided));
    head.albedo = as_tensor(morphable::texture_basis(mesh.vertices, mesh.parts, mesh.albedo));
    head.landmarks = morphable::landmark_vertices(mesh, parameters);
    head.triangles = std::move(mesh.triangles);
    head.parts = std::move(mesh.parts);
    return head;
}

}  // namespace stymo
