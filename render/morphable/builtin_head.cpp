#include "render/morphable/builtin_head.h"

#include "render/morphable/displacement.h"
#include "render/morphable/landmarks.h"

namespace stymo {

namespace {

[[nodiscard]] MorphableHead generated_head() {
    const morphable::HeadParameters parameters;
    morphable::HeadMesh mesh = morphable::generate_head(parameters);
    const Shape vertices{static_cast<std::int64_t>(mesh.vertices.size()), 3};
    MorphableHead head;
    head.mean = morphable::rows_tensor({mesh.vertices}).reshaped(vertices);
    head.mean_albedo = morphable::rows_tensor({mesh.albedo}).reshaped(vertices);
    head.identity = morphable::rows_tensor(morphable::identity_basis(mesh));
    head.expression = morphable::rows_tensor(morphable::expression_basis(mesh, head.one_sided));
    head.albedo =
        morphable::rows_tensor(morphable::texture_basis(mesh.vertices, mesh.parts, mesh.albedo));
    head.expression_names = morphable::expression_names();
    std::vector<float> places;
    for (const Eigen::Vector2d& place : mesh.grid_uv)
        places.insert(places.end(), {static_cast<float>(place[0]), static_cast<float>(place[1])});
    head.grid_uv = Tensor::from({vertices[0], 2}, std::span<const float>(places));
    head.landmarks = morphable::landmark_vertices(mesh, parameters);
    head.triangles = std::move(mesh.triangles);
    head.parts = std::move(mesh.parts);
    return head;
}

}  // namespace

const MorphableHead& builtin_head() {
    static const MorphableHead head = generated_head();
    return head;
}

}  // namespace stymo
