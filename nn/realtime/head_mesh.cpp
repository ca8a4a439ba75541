#include "nn/realtime/head_mesh.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/engine/compositing.h"
#include "nn/engine/packed_field.h"
#include "nn/realtime/view.h"

namespace stymo {

Eigen::Vector3d VertexGrid::position(std::int64_t index) const {
    const std::array<std::int64_t, 3> steps = coordinates(index);
    return origin + spacing * Eigen::Vector3<std::int64_t>(steps.data()).cast<double>();
}

VertexGrid cover(const Box& box, std::int64_t cells) {
    const Eigen::Vector3d sides = box.upper - box.lower;
    VertexGrid grid{box.lower, sides.maxCoeff() / static_cast<double>(cells), {}};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double exact = sides[axis] / grid.spacing;
        grid.vertices[axis] =
            std::max<std::int64_t>(static_cast<std::int64_t>(std::ceil(exact - 1e-6)), 1) + 1;
    }
    return grid;
}

namespace {

constexpr std::int64_t points_at_once = 1 << 16;
/// Cells of the coarse grid on which the head is searched, and cells by which the head may extend
/// beyond the mesh found there.
constexpr std::int64_t coarse_resolution = 40;
constexpr double coarse_margin = 1.5;

/// The box that is searched: as wide as a view of the whole head at its origin, from the near plane
/// to the depth of a head. No photo shows points behind it.
Box searched_box(const ModelConfig& model) {
    const double half = 0.5 * model.camera.distance / model.camera.intrinsics.focal;
    const double side = whole_head_distance * half;
    const RaySampling& rays = model.decoder.rays;
    return {{-side, -side, std::max(rays.far_z, std::min(-half, rays.near_z - 2.0 * half))},
            {side, side, rays.near_z}};
}

/// The bounding box of the mesh enlarged by `margin`, but within `limit`.
Box box_around(const TriangleMesh& mesh, double margin, const Box& limit) {
    Box box{limit.upper, limit.lower};
    const std::span<const float> vertices = mesh.vertices.values<float>();
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const auto coordinate = static_cast<double>(vertices[i]);
        const auto axis = static_cast<Eigen::Index>(i % 3);
        double& lower = box.lower[axis];
        double& upper = box.upper[axis];
        lower = std::max(std::min(lower, coordinate - margin), limit.lower[axis]);
        upper = std::min(std::max(upper, coordinate + margin), limit.upper[axis]);
    }
    return box;
}

/// The density's logits at the vertices (z, y, x). Between vertices they are closer to linear than
/// densities.
Tensor logits_at(const Model& model, const Codes& w, const VertexGrid& grid) {
    Tensor result({grid.vertices[2], grid.vertices[1], grid.vertices[0]});
    const std::span<float> logits = result.mutable_values<float>();
    if (model.decoder().folds()) {
        const PackedField<float> field(model.decoder().folded_field(w));
        evaluate_points(
            field, grid.size(), [&](std::int64_t i) { return grid.position(i); },
            [&](std::int64_t first, std::int64_t size, const FieldTile<float>& tile) {
                std::copy_n(tile.logits.begin(), size, logits.begin() + first);
            });
        return result;
    }
    for (std::int64_t begin = 0; begin < grid.size(); begin += points_at_once) {
        const std::int64_t size = std::min(points_at_once, grid.size() - begin);
        Tensor points({1, size, 3});
        const std::span<float> coordinates = points.mutable_values<float>();
        for (std::int64_t i = 0; i < size; ++i)
            std::ranges::copy(grid.position(begin + i), coordinates.begin() + 3 * i);
        const Tensor density = model.decoder().density(points, w).value();
        std::ranges::transform(density.values<float>(), logits.begin() + begin, inverse_softplus);
    }
    return result;
}

}  // namespace

TriangleMesh head_mesh(const Model& model, const Codes& codes, std::int64_t index,
                       const HeadMeshOptions& options) {
    if (options.resolution < 2)
        fail<ValueError>("a mesh needs 2 cells or more along its side, got ", options.resolution);
    const Codes w = model.decoder().map(codes_of_face(codes, index));
    const double level = inverse_softplus(static_cast<float>(options.level));
    const auto piece = [&](const VertexGrid& grid) {
        const Tensor logits = logits_at(model, w, grid);
        TriangleMesh mesh = largest_piece(isosurface(logits, grid.origin, grid.spacing, level));
        if (mesh.triangles.empty()) {
            fail<ValueError>("no density of this face reaches ", options.level, "; the largest is ",
                             softplus(std::ranges::max(logits.values<float>())));
        }
        return mesh;
    };
    const Box whole = searched_box(model.config());
    const VertexGrid coarse = cover(whole, coarse_resolution);
    return piece(cover(box_around(piece(coarse), coarse_margin * coarse.spacing, whole),
                       options.resolution));
}

}  // namespace stymo
