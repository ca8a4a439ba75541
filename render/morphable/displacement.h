#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/morphable/head_generator.h"

namespace stymo::morphable {

/// Symmetry of a displacement with respect to the plane x = 0.
enum class Symmetry { none, mirrored, opposed };

/// A smooth displacement around a centre: exp(-|(point - center) / radius|^2) (shift + stretch *
/// (point - center)), component by component. With a symmetry other than none, its mirror image
/// (for `opposed`, with the opposite sign) is added. If it is mirrored, the stretch in x is
/// relative to the middle of the face.
struct Displacement {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    Eigen::Vector3d radius = Eigen::Vector3d::Zero();
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();
    Eigen::Vector3d stretch = Eigen::Vector3d::Zero();
    Symmetry symmetry = Symmetry::mirrored;
    std::optional<HeadPart> only{};
    /// Restricts it to one lip: +1 the upper, -1 the lower, 0 both.
    int lip = 0;
};

/// For a displacement without shift or stretch.
inline const Eigen::Vector3d none = Eigen::Vector3d::Zero();

/// One row of a basis: x, y, z of every vertex.
using BasisRow = std::vector<Eigen::Vector3d>;

/// (rows, V, 3) float32.
[[nodiscard]] Tensor rows_tensor(const std::vector<BasisRow>& rows);
/// The displacement of each vertex of the mesh. Eyeballs move as a whole.
[[nodiscard]] BasisRow displaced(const HeadMesh& mesh, std::span<const Displacement> displacements);
/// The effect of one measure on the head: half the difference between the heads with plus and minus
/// `deviation`, or, if one-sided, the difference between the heads with plus `deviation` and
/// without.
[[nodiscard]] BasisRow differentiated(double HeadParameters::*measure, double deviation,
                                      bool one_sided);
/// Bump `index` of `count` smooth bumps in the head's outward direction, evenly spread over the
/// part of the head between `low_z` and `high_z` of the unit sphere. Every third bump has opposite
/// signs on the two sides and is weaker.
[[nodiscard]] Displacement smooth_mode(std::int64_t index, std::int64_t count, double low_z,
                                       double high_z, double amplitude);

/// In each basis the first rows have a specific meaning. Smooth local bumps fill the basis up to
/// the size of the model.
[[nodiscard]] std::vector<BasisRow> identity_basis(const HeadMesh& mesh);
[[nodiscard]] std::vector<BasisRow> expression_basis(const HeadMesh& mesh,
                                                     std::span<bool> one_sided);
/// The names of the expressions that have a meaning.
[[nodiscard]] std::vector<std::string> expression_names();
[[nodiscard]] std::vector<BasisRow> texture_basis(std::span<const Eigen::Vector3d> vertices,
                                                  std::span<const HeadPart> parts,
                                                  std::span<const Eigen::Vector3d> albedo);

}  // namespace stymo::morphable
