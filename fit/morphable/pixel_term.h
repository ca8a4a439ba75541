#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/autograd/variable.h"
#include "fit/morphable/least_squares.h"
#include "fit/morphable/morphable_fit.h"
#include "fit/morphable/vertex_table.h"

/// Not part of the public interface.
namespace stymo::morphable {

/// The vertices whose colours are compared with a photo: some thousand, evenly chosen from the face
/// between the jaw and a little above the brows.
[[nodiscard]] std::vector<std::int32_t> face_vertices(const MorphableHead& head);

/// The colour term of the cost: squared differences between albedo times irradiance at each visible
/// vertex and the photo there. Its weight falls to zero for outliers that the head cannot represent
/// (glasses, hair, highlights).
class PixelTerm {
public:
    PixelTerm(const MorphableHead& head, const VertexTable& face, const MorphableFitTarget& target,
              const Intrinsics& intrinsics, const MorphableFitOptions& options);

    /// Computes the visible vertices, their normals and weights for this state. They stay fixed
    /// until the next call.
    void hold(std::span<const double> state);
    void add_to(NormalEquations& equations, std::span<const double> state) const;
    [[nodiscard]] double cost(std::span<const double> state) const;

private:
    struct Rows;
    [[nodiscard]] Rows rows_at(std::span<const double> state) const;
    [[nodiscard]] Variable photo_at(const Variable& image_points) const;
    [[nodiscard]] Variable residuals(const Rows& rows) const;
    [[nodiscard]] bool inside_mask(double x, double y) const;

    const MorphableHead* head_;
    const VertexTable* face_;
    Intrinsics intrinsics_;
    double color_deviation_;
    double color_observations_;
    Tensor photo_;
    Tensor mask_;
    std::vector<std::size_t> visible_;  ///< rows of the table
    Tensor harmonics_;                  ///< (n, 9, 1), of the visible vertices' normals
    std::vector<double> weights_;       ///< (n, 3)
};

}  // namespace stymo::morphable
