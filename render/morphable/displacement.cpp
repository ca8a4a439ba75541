#include "render/morphable/displacement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/parallel.h"
#include "render/morphable/skin_surface.h"

namespace stymo::morphable {

namespace {

void add_displacement(const Displacement& d, const Eigen::Vector3d& anchor, double factor,
                      bool mirror, Eigen::Vector3d& result) {
    const double sign = mirror ? -1.0 : 1.0;
    const Eigen::Vector3d point{sign * anchor[0], anchor[1], anchor[2]};
    const double weight = factor * gauss((point - d.center).cwiseQuotient(d.radius).norm());
    if (weight == 0.0) return;
    Eigen::Vector3d pivot = d.center;
    if (d.symmetry == Symmetry::mirrored) pivot.x() = 0.0;
    Eigen::Vector3d shift = d.shift + d.stretch.cwiseProduct(point - pivot);
    shift.x() *= sign;
    result += weight * shift;
}

[[nodiscard]] double part_weight(const HeadMesh& mesh, std::size_t vertex, const Displacement& d) {
    if (d.only && mesh.parts[vertex] != *d.only) return 0.0;
    if (d.lip == 0) return 1.0;
    return std::max(0.0, d.lip * mesh.mouth_side[vertex]);
}

/// The point at which a displacement is evaluated for a vertex. Eyeballs move as a whole, and the
/// surrounding skin moves with them, because they would pierce it otherwise.
[[nodiscard]] Eigen::Vector3d anchor_of(const Eigen::Vector3d& point, HeadPart part,
                                        const Eigen::Vector3d& eye) {
    if (part != HeadPart::eyes && part != HeadPart::skin && part != HeadPart::brows) return point;
    const Eigen::Vector3d front{std::copysign(eye[0], point[0]), eye[1], eye[2] + eye_radius};
    if (part == HeadPart::eyes) return front;
    const double distance = std::hypot(point[0] - front[0], point[1] - front[1]);
    return mix(point, front, point[2] > 0.0 ? smooth_step(0.24, 0.15, distance) : 0.0);
}

}  // namespace

Tensor rows_tensor(const std::vector<BasisRow>& rows) {
    Tensor result({static_cast<std::int64_t>(rows.size()),
                   static_cast<std::int64_t>(rows.front().size()), 3});
    float* target = result.mutable_values<float>().data();
    for (const BasisRow& row : rows) {
        for (const Eigen::Vector3d& vector : row) {
            Eigen::Map<Eigen::Vector3f>{target} = vector.cast<float>();
            target += 3;
        }
    }
    return result;
}

BasisRow displaced(const HeadMesh& mesh, std::span<const Displacement> displacements) {
    const Eigen::Vector3d eye = eye_center({});
    BasisRow row(mesh.vertices.size(), Eigen::Vector3d::Zero());
    const auto move = [&](std::size_t vertex) {
        const Eigen::Vector3d anchor = anchor_of(mesh.vertices[vertex], mesh.parts[vertex], eye);
        for (const Displacement& d : displacements) {
            const double weight = part_weight(mesh, vertex, d);
            if (weight == 0.0) continue;
            add_displacement(d, anchor, weight, false, row[vertex]);
            if (d.symmetry != Symmetry::none)
                add_displacement(d, anchor, d.symmetry == Symmetry::opposed ? -weight : weight,
                                 true, row[vertex]);
        }
    };
    parallel_for(std::ssize(row), 2048, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t vertex = begin; vertex < end; ++vertex)
            move(static_cast<std::size_t>(vertex));
    });
    return row;
}

BasisRow differentiated(double HeadParameters::*measure, double deviation, bool one_sided) {
    std::array<HeadMesh, 2> meshes;
    parallel_for(2, 1, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t side = begin; side < end; ++side) {
            HeadParameters parameters;
            if (side == 0) parameters.*measure += deviation;
            if (side == 1 && !one_sided) parameters.*measure -= deviation;
            meshes[static_cast<std::size_t>(side)] = generate_head(parameters);
        }
    });
    const auto& [high, low] = meshes;
    const double scale = one_sided ? 1.0 : 0.5;
    BasisRow row(high.vertices.size());
    for (std::size_t vertex = 0; vertex < row.size(); ++vertex)
        row[vertex] = scale * (high.vertices[vertex] - low.vertices[vertex]);
    return row;
}

Displacement smooth_mode(std::int64_t index, std::int64_t count, double low_z, double high_z,
                         double amplitude) {
    const double z =
        high_z + (low_z - high_z) * (static_cast<double>(index) + 0.5) / static_cast<double>(count);
    const double around = static_cast<double>(index) * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double ring = std::sqrt(std::max(0.0, 1.0 - z * z));
    const Eigen::Vector3d direction{ring * std::cos(around), ring * std::sin(around), z};
    const bool opposed = index % 3 == 2;
    const double size = opposed ? 0.5 * amplitude : amplitude;
    return {direction.cwiseProduct(Eigen::Vector3d(0.70, 0.95, 0.85)),
            {0.30, 0.30, 0.40},
            size * direction,
            Eigen::Vector3d::Zero(),
            opposed ? Symmetry::opposed : Symmetry::mirrored};
}

}  // namespace stymo::morphable
