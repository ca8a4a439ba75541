#include "fit/morphable/contour.h"

#include <algorithm>
#include <cmath>

namespace stymo::morphable {

namespace {

[[nodiscard]] Vector3 point_at(std::span<const float> points, std::int32_t vertex) {
    const auto* p = &points[3 * static_cast<std::size_t>(vertex)];
    return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}

/// Unit vector in the frontal plane, at right angles to the jaw's line at landmark k and away from the face.
[[nodiscard]] Vector3 outward_direction(const MorphableHead& head, std::size_t k) {
    const auto points = head.mean.values<float>();
    const Vector3 before = point_at(points, head.landmarks[k == 0 ? 0 : k - 1]);
    const Vector3 after = point_at(points, head.landmarks[std::min<std::size_t>(k + 1, 16)]);
    const Vector3 tangent{after[0] - before[0], after[1] - before[1], 0.0};
    const double length = std::max(std::hypot(tangent[0], tangent[1]), 1e-9);
    // Landmarks 0 to 16 run down, right and up again: the face lies to their left.
    return {tangent[1] / length, -tangent[0] / length, 0.0};
}

/// The vertices that landmark k of the jaw may slide to, itself first. All in units of about a decimetre.
[[nodiscard]] std::vector<std::int32_t> slide_vertices(const MorphableHead& head, std::size_t k, const Vector3& outward) {
    constexpr double half_thickness = 0.02;
    constexpr double backwards = 0.02;
    constexpr double inwards = 0.35;  // stops short of the nose
    constexpr double outwards = 0.15;
    const auto points = head.mean.values<float>();
    const Vector3 start = point_at(points, head.landmarks[k]);
    std::vector<std::int32_t> result{head.landmarks[k]};
    for (std::size_t vertex = 0; vertex < head.parts.size(); ++vertex) {
        if (head.parts[vertex] != HeadPart::skin) continue;
        const Vector3 point = point_at(points, static_cast<std::int32_t>(vertex));
        const double x = point[0] - start[0];
        const double y = point[1] - start[1];
        const double out = x * outward[0] + y * outward[1];
        const double along = x * outward[1] - y * outward[0];
        if (std::abs(along) < half_thickness && out > -inwards && out < outwards && point[2] > start[2] - backwards)
            result.push_back(static_cast<std::int32_t>(vertex));
    }
    return result;
}

}  // namespace

Contour::Contour(const MorphableHead& head)
    : table_(head, [&] {
          std::vector<std::int32_t> vertices(head.landmarks.begin(), head.landmarks.end());
          for (std::size_t k = 0; k < slides_.size(); ++k) {
              const Vector3 outward = outward_direction(head, k);
              const std::vector<std::int32_t> slide = slide_vertices(head, k, outward);
              slides_[k] = {vertices.size(), vertices.size() + slide.size(), outward};
              vertices.insert(vertices.end(), slide.begin(), slide.end());
          }
          return vertices;
      }()) {}

std::array<std::size_t, 68> Contour::rows(std::span<const double> points, const Camera& camera) const {
    std::array<std::size_t, 68> result{};
    for (std::size_t k = 0; k < result.size(); ++k) result[k] = k;
    for (std::size_t k = 0; k < slides_.size(); ++k) {
        std::array<double, 2> direction{};
        for (std::size_t axis = 0; axis < 2; ++axis) {
            for (std::size_t j = 0; j < 3; ++j) direction[axis] += camera.world_from_camera[j][axis] * slides_[k].outward[j];
        }
        double farthest = -1e300;
        for (std::size_t row = slides_[k].begin; row < slides_[k].end; ++row) {
            const Vector3 seen = project(camera, {points[3 * row], points[3 * row + 1], points[3 * row + 2]});
            const double out = seen[0] * direction[0] + seen[1] * direction[1];
            if (out > farthest) {
                farthest = out;
                result[k] = row;
            }
        }
    }
    return result;
}

}  // namespace stymo::morphable
