#include "render/triangle_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <span>

namespace stymo {

namespace {

/// Six times the signed volume between a triangle and the origin.
double signed_volume(std::span<const float> vertices, const std::array<std::int32_t, 3>& triangle) {
    const auto corner = [&](std::size_t i) -> Eigen::Vector3d {
        const auto first = 3 * static_cast<std::size_t>(triangle[i]);
        return Eigen::Map<const Eigen::Vector3f>(&vertices[first]).cast<double>();
    };
    return corner(0).dot(corner(1).cross(corner(2)));
}

}  // namespace

std::vector<std::int32_t> pieces_of(std::int64_t vertex_count,
                                    std::span<const std::array<std::int32_t, 3>> triangles) {
    std::vector<std::int32_t> parent(static_cast<std::size_t>(vertex_count));
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](std::int32_t vertex) {
        while (parent[static_cast<std::size_t>(vertex)] != vertex) {
            std::int32_t& above = parent[static_cast<std::size_t>(vertex)];
            above = parent[static_cast<std::size_t>(above)];
            vertex = above;
        }
        return vertex;
    };
    for (const std::array<std::int32_t, 3>& triangle : triangles) {
        for (const std::int32_t other : {triangle[1], triangle[2]})
            parent[static_cast<std::size_t>(root(other))] = root(triangle[0]);
    }
    for (std::size_t vertex = 0; vertex < parent.size(); ++vertex)
        parent[vertex] = root(static_cast<std::int32_t>(vertex));
    return parent;
}

double enclosed_volume(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const std::array<std::int32_t, 3>& triangle : mesh.triangles)
        sum += signed_volume(mesh.vertices.values<float>(), triangle);
    return sum / 6.0;
}

TriangleMesh largest_piece(const TriangleMesh& mesh) {
    if (mesh.triangles.empty()) return mesh;
    const std::span<const float> vertices = mesh.vertices.values<float>();
    const std::vector<std::int32_t> piece = pieces_of(mesh.vertices.shape(0), mesh.triangles);
    std::vector<double> volumes(piece.size());
    for (const std::array<std::int32_t, 3>& triangle : mesh.triangles)
        volumes[static_cast<std::size_t>(piece[static_cast<std::size_t>(triangle[0])])] +=
            signed_volume(vertices, triangle);
    const auto largest =
        static_cast<std::int32_t>(std::ranges::max_element(volumes) - volumes.begin());

    std::vector<std::int32_t> new_index(piece.size(), -1);
    std::vector<float> kept;
    for (std::size_t vertex = 0; vertex < piece.size(); ++vertex) {
        if (piece[vertex] != largest) continue;
        new_index[vertex] = static_cast<std::int32_t>(kept.size() / 3);
        kept.insert(kept.end(), vertices.begin() + static_cast<std::ptrdiff_t>(3 * vertex),
                    vertices.begin() + static_cast<std::ptrdiff_t>(3 * vertex + 3));
    }
    TriangleMesh result{
        Tensor::from({static_cast<std::int64_t>(kept.size() / 3), 3}, std::span<const float>(kept)),
        {}};
    for (std::array<std::int32_t, 3> triangle : mesh.triangles) {
        if (piece[static_cast<std::size_t>(triangle[0])] != largest) continue;
        for (std::int32_t& vertex : triangle) vertex = new_index[static_cast<std::size_t>(vertex)];
        result.triangles.push_back(triangle);
    }
    return result;
}

}  // namespace stymo
