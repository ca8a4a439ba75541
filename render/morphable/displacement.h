#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/morphable/head_generator.h"

namespace stymo::morphable {

/// What the other half of the face does.
enum class Symmetry { none, mirrored, opposed };

/// A smooth displacement around a centre: exp(-|(point - center) / radius|^2) (shift + stretch * (point - center)), component by
/// component. Mirrored, its mirror image is added, and the stretch in x is about the middle of the face.
struct Displacement {
    Vector3 center{};
    Vector3 radius{};
    Vector3 shift{};
    Vector3 stretch{};
    Symmetry symmetry = Symmetry::mirrored;
    std::optional<HeadPart> only{};
    /// Lifts or lowers one lip alone: +1 the upper, -1 the lower, 0 both.
    int lip = 0;
};

/// One row of a basis: for every vertex x, y, z.
using BasisRow = std::vector<Vector3>;

/// (rows, V, 3) float32.
[[nodiscard]] Tensor rows_tensor(const std::vector<BasisRow>& rows);
/// The displacement of each vertex of the mesh. Eyeballs move as a whole.
[[nodiscard]] BasisRow displaced(const HeadMesh& mesh, std::span<const Displacement> displacements);
/// How the head changes with one of its measures: half the difference between `deviation` more and as much less, or, one-sided,
/// the difference between `deviation` more and none.
[[nodiscard]] BasisRow differentiated(double HeadParameters::*measure, double deviation, bool one_sided);
/// Mode `index` of `count` smooth bumps along the head's outward direction, evenly spread over the part of the head between
/// `low_z` and `high_z` of the unit sphere; every third is opposed on the two sides and weaker.
[[nodiscard]] Displacement smooth_mode(std::int64_t index, std::int64_t count, double low_z, double high_z, double amplitude);

/// The first rows have a meaning each; smooth local modes fill up to the model's size.
[[nodiscard]] std::vector<BasisRow> identity_basis(const HeadMesh& mesh);
[[nodiscard]] std::vector<BasisRow> expression_basis(const HeadMesh& mesh, std::span<bool> one_sided);
[[nodiscard]] std::vector<BasisRow> texture_basis(std::span<const Vector3> vertices, std::span<const HeadPart> parts,
                                                  std::span<const Vector3> albedo);

}  // namespace stymo::morphable
