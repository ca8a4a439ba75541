#include "render/triangle_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <utility>

#include "core/error.h"

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

TriangleMesh largest_piece(const TriangleMesh& mesh) {
    if (mesh.triangles.empty()) return mesh;
    const std::span<const float> vertices = mesh.vertices.values<float>();
    const std::vector<std::int32_t> piece = pieces_of(mesh.vertices.shape(0), mesh.triangles);
    constexpr double none = -std::numeric_limits<double>::infinity();
    std::vector<double> volumes(piece.size(), none);
    for (const std::array<std::int32_t, 3>& triangle : mesh.triangles)
        volumes[static_cast<std::size_t>(piece[static_cast<std::size_t>(triangle[0])])] = 0.0;
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

namespace {

/// Corners of a cube and of a tetrahedron are sets of axes: bit a is set where the corner is the
/// farther one along axis a.
using Corner = std::uint32_t;
constexpr Corner all_axes = 7;
constexpr std::int64_t directions = 7;

/// One of the six tetrahedra around the cube's diagonal: a path from corner 0 to corner 7, axis by
/// axis. Cubes that share a face cut it the same way.
struct Tetrahedron {
    std::array<Corner, 4> corners;
    bool mirrored;
};
constexpr Tetrahedron along(Corner first, Corner second, bool mirrored) {
    return {{0, first, first | second, all_axes}, mirrored};
}
constexpr std::array<Tetrahedron, 6> tetrahedra{along(1, 2, false), along(2, 4, false),
                                                along(4, 1, false), along(2, 1, true),
                                                along(4, 2, true),  along(1, 4, true)};

/// Even permutations of a tetrahedron's corners, indexed by the corner that comes first, or by the
/// two corners that come first.
using Order = std::array<std::uint8_t, 4>;
constexpr std::array<Order, 4> corner_first{
    {{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 0, 1, 3}, {3, 0, 2, 1}}};
constexpr std::array<Order, 6> pair_first{
    {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {1, 2, 0, 3}, {1, 3, 2, 0}, {2, 3, 0, 1}}};

class Surface {
public:
    Surface(const Tensor& values, const Eigen::Vector3d& origin, double spacing, double level)
        : values_(values.values<float>()),
          size_{values.shape(2) + 2, values.shape(1) + 2, values.shape(0) + 2},
          origin_(origin),
          spacing_(spacing),
          level_(level),
          outside_(level - 1.0) {
        for (std::vector<std::int32_t>& slice : edges_)
            slice.assign(static_cast<std::size_t>(size_[0] * size_[1] * directions), -1);
    }

    TriangleMesh extracted() {
        for (std::int64_t z = 0; z + 1 < size_[2]; ++z) {
            for (std::int64_t y = 0; y + 1 < size_[1]; ++y) {
                for (std::int64_t x = 0; x + 1 < size_[0]; ++x) add_cube({x, y, z});
            }
            std::swap(edges_[0], edges_[1]);
            std::ranges::fill(edges_[1], -1);
        }
        TriangleMesh mesh{Tensor({static_cast<std::int64_t>(vertices_.size() / 3), 3}),
                          std::move(triangles_)};
        std::ranges::copy(vertices_, mesh.vertices.mutable_values<float>().begin());
        return mesh;
    }

private:
    using Coordinates = std::array<std::int64_t, 3>;

    /// The value at a vertex of the grid, which is extended by a margin of one vertex.
    [[nodiscard]] double value(const Coordinates& vertex) const {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            if (vertex[axis] == 0 || vertex[axis] + 1 == size_[axis]) return outside_;
        }
        const std::int64_t index =
            ((vertex[2] - 1) * (size_[1] - 2) + vertex[1] - 1) * (size_[0] - 2) + vertex[0] - 1;
        return static_cast<double>(values_[static_cast<std::size_t>(index)]);
    }

    static Coordinates corner_of(const Coordinates& cube, Corner corner) {
        return {cube[0] + (corner & 1), cube[1] + (corner >> 1 & 1), cube[2] + (corner >> 2)};
    }

    void add_cube(const Coordinates& cube) {
        unsigned inside = 0;
        for (Corner corner = 0; corner <= all_axes; ++corner) {
            corner_values_[corner] = value(corner_of(cube, corner));
            if (corner_values_[corner] >= level_) inside |= 1U << corner;
        }
        if (inside == 0 || inside == 0xFFU) return;
        for (const Tetrahedron& tetrahedron : tetrahedra)
            add_tetrahedron(cube, tetrahedron, inside);
    }

    void add_tetrahedron(const Coordinates& cube, const Tetrahedron& tetrahedron,
                         unsigned inside_corners) {
        unsigned inside = 0;
        for (unsigned i = 0; i < 4; ++i)
            inside |= (inside_corners >> tetrahedron.corners[i] & 1U) << i;
        const auto cut = [&](std::uint8_t a, std::uint8_t b) {
            const auto [lower, upper] = std::minmax(tetrahedron.corners[a], tetrahedron.corners[b]);
            return vertex_on(cube, lower, upper);
        };
        const int count = std::popcount(inside);
        if (count == 1 || count == 3) {
            const unsigned alone = count == 1 ? inside : ~inside & 0xFU;
            const auto [i, j, k, l] =
                corner_first[static_cast<std::size_t>(std::countr_zero(alone))];
            add_triangle({cut(i, j), cut(i, k), cut(i, l)}, tetrahedron.mirrored != (count == 3));
        } else if (count == 2) {
            const auto* const order = std::ranges::find_if(pair_first, [&](const Order& o) {
                return inside == ((1U << o[0]) | (1U << o[1]));
            });
            const auto [i, j, k, l] = *order;
            const std::array<std::int32_t, 4> quad{cut(i, k), cut(i, l), cut(j, l), cut(j, k)};
            add_triangle({quad[0], quad[1], quad[2]}, tetrahedron.mirrored);
            add_triangle({quad[0], quad[2], quad[3]}, tetrahedron.mirrored);
        }
    }

    void add_triangle(std::array<std::int32_t, 3> triangle, bool reversed) {
        if (reversed) std::swap(triangle[1], triangle[2]);
        triangles_.push_back(triangle);
    }

    /// Lower corners of a path are subsets of upper ones, so an edge is identified by its lower end
    /// and the set of its axes.
    std::int32_t vertex_on(const Coordinates& cube, Corner lower, Corner upper) {
        const Coordinates begin = corner_of(cube, lower);
        std::vector<std::int32_t>& slice = edges_[lower >> 2];
        std::int32_t& vertex = slice[static_cast<std::size_t>(
            (begin[1] * size_[0] + begin[0]) * directions + (upper ^ lower) - 1)];
        if (vertex >= 0) return vertex;
        if (triangles_.size() > 2'000'000'000)
            fail<ValueError>("the surface has too many triangles; choose a coarser grid");
        vertex = static_cast<std::int32_t>(vertices_.size() / 3);
        const double part =
            (level_ - corner_values_[lower]) / (corner_values_[upper] - corner_values_[lower]);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const double along_edge = ((upper ^ lower) >> axis & 1U) != 0 ? part : 0.0;
            vertices_.push_back(
                static_cast<float>(origin_[static_cast<Eigen::Index>(axis)] +
                                   spacing_ * (static_cast<double>(begin[axis] - 1) + along_edge)));
        }
        return vertex;
    }

    std::span<const float> values_;
    Coordinates size_;
    Eigen::Vector3d origin_;
    double spacing_;
    double level_;
    double outside_;
    std::array<double, 8> corner_values_{};
    /// Vertices on the edges that begin in the current slice of the grid and in the next one, -1
    /// where there is none yet.
    std::array<std::vector<std::int32_t>, 2> edges_;
    std::vector<float> vertices_;
    std::vector<std::array<std::int32_t, 3>> triangles_;
};

}  // namespace

TriangleMesh isosurface(const Tensor& values, const Eigen::Vector3d& origin, double spacing,
                        double level) {
    if (values.rank() != 3 || std::ranges::any_of(values.shape().extents(),
                                                  [](std::int64_t extent) { return extent < 2; }))
        fail<ShapeError>("a surface needs values (z, y, x), two or more along each axis; got ",
                         values.shape());
    if (!values.all_finite()) fail<ValueError>("a surface needs values that are finite");
    return Surface(values, origin, spacing, level).extracted();
}

}  // namespace stymo
