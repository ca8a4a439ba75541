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

/// Where a view sees the 68 landmarks. Those of the jaw (0 to 16) are not places of the head but of
/// its outline: each slides in the plane that its outward direction and the depth axis span, to the
/// point that the image shows farthest out.
class Contour {
public:
    explicit Contour(const MorphableHead& head);

    /// Every vertex that a landmark may be at.
    [[nodiscard]] const VertexTable& table() const { return table_; }
    /// The row of table() at which a camera sees each landmark, given the rows' world points (N,
    /// 3).
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
