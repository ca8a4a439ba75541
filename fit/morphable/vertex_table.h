#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/camera.h"
#include "render/morphable/head.h"

/// Not part of the public interface.
namespace stymo::morphable {

/// A selection of a head's vertices. For each vertex the rows of all bases are contiguous.
struct VertexTable {
    using Rows = Eigen::Matrix<float, 3, Eigen::Dynamic, Eigen::RowMajor>;

    VertexTable(const MorphableHead& head, std::vector<std::int32_t> chosen);

    [[nodiscard]] std::size_t size() const { return vertices.size(); }
    /// Derivative of a vertex's coordinates with respect to the shape codes (identity, then
    /// expression).
    [[nodiscard]] Eigen::Map<const Rows> shape_rows(std::size_t vertex) const;
    /// Derivative of its albedo with respect to the texture code.
    [[nodiscard]] Eigen::Map<const Rows> color_rows(std::size_t vertex) const;

    std::vector<std::int32_t> vertices;
    std::vector<float> mean;         ///< (N, 3)
    std::vector<float> shape;        ///< (N, 3, 179)
    std::vector<float> mean_albedo;  ///< (N, 3)
    std::vector<float> color;        ///< (N, 3, 100)
};

/// World points (N, 3) of a state (state.h).
[[nodiscard]] std::vector<double> table_points(const VertexTable& table,
                                               std::span<const double> state);
/// One of these points.
[[nodiscard]] Eigen::Vector3d table_point(const VertexTable& table, std::size_t row,
                                          std::span<const double> state);
/// Albedo (N, 3) of a state, not clipped.
[[nodiscard]] std::vector<double> table_albedo(const VertexTable& table,
                                               std::span<const double> state);

/// The vertices of the 68 landmarks in a view. The points of the jaw (0 to 16) are not fixed on the
/// head but lie on its outline in the view. Each is chosen among vertices in the plane of its
/// outward direction and the depth axis: the vertex that is farthest out in the image.
class Contour {
public:
    explicit Contour(const MorphableHead& head);

    /// All vertices that a landmark may use.
    [[nodiscard]] const VertexTable& table() const { return table_; }
    /// For each landmark the row of table() for a camera, given the rows' world points (N, 3).
    [[nodiscard]] std::array<std::size_t, 68> rows(std::span<const double> points,
                                                   const Camera& camera) const;

private:
    struct Slide {
        std::size_t begin;  ///< rows of the table
        std::size_t end;
        Eigen::Vector3d outward;
    };

    std::array<Slide, 17> slides_{};
    VertexTable table_;
};

}  // namespace stymo::morphable
