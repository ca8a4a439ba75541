#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>

#include "render/triangle_mesh.h"

namespace stymo::test {

/// Volume enclosed by a closed mesh.
inline double enclosed_volume(const TriangleMesh& mesh) {
    const std::span<const float> values = mesh.vertices.values<float>();
    const auto corner = [&](std::int32_t vertex) {
        return Eigen::Map<const Eigen::Vector3f>(values.data() + std::ptrdiff_t{3} * vertex)
            .cast<double>()
            .eval();
    };
    double sum = 0.0;
    for (const std::array<std::int32_t, 3>& triangle : mesh.triangles)
        sum += corner(triangle[0]).dot(corner(triangle[1]).cross(corner(triangle[2])));
    return sum / 6.0;
}

}  // namespace stymo::test
