#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "fit/morphable/vertex_table.h"
#include "render/camera.h"
#include "render/morphable/head.h"

/// Not part of the public interface.
namespace stymo::morphable {

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
