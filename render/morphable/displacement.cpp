#include "render/morphable/displacement.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/morphable/skin_surface.h"

namespace stymo::morphable {

namespace {

void add_displacement(const Displacement& d, const Vector3& anchor, double factor, bool mirror, Vector3& result) {
    const double sign = mirror ? -1.0 : 1.0;
    const Vector3 point{sign * anchor[0], anchor[1], anchor[2]};
    double exponent = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double distance = (point[axis] - d.center[axis]) / d.radius[axis];
        exponent += distance * distance;
    }
    const double weight = factor * std::exp(-exponent);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double pivot = axis == 0 && d.symmetry == Symmetry::mirrored ? 0.0 : d.center[axis];
        const double direction = axis == 0 ? sign : 1.0;
        result[axis] += weight * direction * (d.shift[axis] + d.stretch[axis] * (point[axis] - pivot));
    }
}

[[nodiscard]] double part_weight(const HeadMesh& mesh, std::size_t vertex, const Displacement& d) {
    if (d.only && mesh.parts[vertex] != *d.only) return 0.0;
    if (d.lip == 0) return 1.0;
    return std::max(0.0, d.lip * mesh.mouth_side[vertex]);
}

/// Where a displacement is taken for a vertex: eyeballs move as a whole, and the skin around goes with them, or they would pierce
/// it.
[[nodiscard]] Vector3 anchor_of(const Vector3& point, HeadPart part, const Vector3& eye) {
    if (part != HeadPart::eyes && part != HeadPart::skin && part != HeadPart::brows) return point;
    const Vector3 front{std::copysign(eye[0], point[0]), eye[1], eye[2] + eye_radius};
    if (part == HeadPart::eyes) return front;
    const double distance = std::hypot(point[0] - front[0], point[1] - front[1]);
    return mix(point, front, point[2] > 0.0 ? smooth_step(0.24, 0.15, distance) : 0.0);
}

}  // namespace

Tensor rows_tensor(const std::vector<BasisRow>& rows) {
    Tensor result({static_cast<std::int64_t>(rows.size()), static_cast<std::int64_t>(rows.front().size()), 3});
    auto target = result.mutable_values<float>().begin();
    for (const BasisRow& row : rows) {
        for (const Vector3& vector : row) {
            target = std::transform(vector.begin(), vector.end(), target, [](double value) { return static_cast<float>(value); });
        }
    }
    return result;
}

BasisRow displaced(const HeadMesh& mesh, std::span<const Displacement> displacements) {
    const Vector3 eye = eye_center({});
    BasisRow row(mesh.vertices.size());
    for (std::size_t vertex = 0; vertex < row.size(); ++vertex) {
        const Vector3 anchor = anchor_of(mesh.vertices[vertex], mesh.parts[vertex], eye);
        for (const Displacement& d : displacements) {
            const double weight = part_weight(mesh, vertex, d);
            if (weight == 0.0) continue;
            add_displacement(d, anchor, weight, false, row[vertex]);
            if (d.symmetry != Symmetry::none)
                add_displacement(d, anchor, d.symmetry == Symmetry::opposed ? -weight : weight, true, row[vertex]);
        }
    }
    return row;
}

BasisRow differentiated(double HeadParameters::*measure, double deviation, bool one_sided) {
    HeadParameters more;
    HeadParameters less;
    more.*measure += deviation;
    if (!one_sided) less.*measure -= deviation;
    const HeadMesh high = generate_head(more);
    const HeadMesh low = generate_head(less);
    const double scale = one_sided ? 1.0 : 0.5;
    BasisRow row(high.vertices.size());
    for (std::size_t vertex = 0; vertex < row.size(); ++vertex) {
        for (std::size_t axis = 0; axis < 3; ++axis)
            row[vertex][axis] = scale * (high.vertices[vertex][axis] - low.vertices[vertex][axis]);
    }
    return row;
}

Displacement smooth_mode(std::int64_t index, std::int64_t count, double low_z, double high_z, double amplitude) {
    const double z = high_z + (low_z - high_z) * (static_cast<double>(index) + 0.5) / static_cast<double>(count);
    const double around = static_cast<double>(index) * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double ring = std::sqrt(std::max(0.0, 1.0 - z * z));
    const Vector3 direction{ring * std::cos(around), ring * std::sin(around), z};
    const bool opposed = index % 3 == 2;
    const double size = opposed ? 0.5 * amplitude : amplitude;
    return {{0.70 * direction[0], 0.95 * direction[1], 0.85 * direction[2]},
            {0.30, 0.30, 0.40},
            {size * direction[0], size * direction[1], size * direction[2]},
            {},
            opposed ? Symmetry::opposed : Symmetry::mirrored};
}

}  // namespace stymo::morphable
