#include "fit/morphable/vertex_table.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "fit/morphable/state.h"

namespace stymo::morphable {

namespace {

constexpr std::size_t color_size = 100;

void gather(std::span<const float> basis, std::size_t basis_rows, std::size_t basis_columns,
            std::span<const std::int32_t> vertices, std::size_t row_length, std::size_t first,
            std::span<float> target) {
    // A few rows of the basis at a time, so that all memory is used in whole cache lines.
    constexpr std::size_t at_once = 16;
    const auto gather_some = [&](std::int64_t begin, std::int64_t end) {
        for (std::size_t row = 0; row < basis_rows; row += at_once) {
            const std::size_t end_row = std::min(row + at_once, basis_rows);
            for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
                const std::size_t source = 3 * static_cast<std::size_t>(vertices[i]);
                for (std::size_t axis = 0; axis < 3; ++axis)
                    for (std::size_t k = row; k < end_row; ++k)
                        target[(3 * i + axis) * row_length + first + k] =
                            basis[k * basis_columns + source + axis];
            }
        }
    };
    parallel_for(std::ssize(vertices), 256, gather_some);
}

[[nodiscard]] double linear_value(float mean, const float* row, std::span<const double> code) {
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (std::size_t k = 0; k < code.size(); ++k) sum += static_cast<double>(row[k]) * code[k];
    return static_cast<double>(mean) + sum;
}

[[nodiscard]] std::vector<double> linear_model(std::span<const float> mean,
                                               std::span<const float> rows,
                                               std::span<const double> code) {
    std::vector<double> result(mean.size());
    for (std::size_t i = 0; i < result.size(); ++i)
        result[i] = linear_value(mean[i], &rows[i * code.size()], code);
    return result;
}

}  // namespace

VertexTable::VertexTable(const MorphableHead& head, std::vector<std::int32_t> chosen)
    : vertices(std::move(chosen)),
      mean(3 * vertices.size()),
      shape(3 * vertices.size() * shape_size),
      mean_albedo(3 * vertices.size()),
      color(3 * vertices.size() * color_size) {
    const auto columns = static_cast<std::size_t>(3 * head.vertex_count());
    gather(head.mean.values<float>(), 1, columns, vertices, 1, 0, mean);
    gather(head.mean_albedo.values<float>(), 1, columns, vertices, 1, 0, mean_albedo);
    gather(head.identity.values<float>(), 100, columns, vertices, shape_size, 0, shape);
    gather(head.expression.values<float>(), 79, columns, vertices, shape_size, 100, shape);
    gather(head.albedo.values<float>(), color_size, columns, vertices, color_size, 0, color);
}

Eigen::Map<const VertexTable::Rows> VertexTable::shape_rows(std::size_t vertex) const {
    return {&shape[3 * vertex * shape_size], 3, shape_size};
}

Eigen::Map<const VertexTable::Rows> VertexTable::color_rows(std::size_t vertex) const {
    return {&color[3 * vertex * color_size], 3, color_size};
}

std::vector<double> table_points(const VertexTable& table, std::span<const double> state) {
    return linear_model(table.mean, table.shape, state.subspan(identity_begin, shape_size));
}

Eigen::Vector3d table_point(const VertexTable& table, std::size_t row,
                            std::span<const double> state) {
    Eigen::Vector3d point;
    for (std::size_t axis = 0; axis < 3; ++axis)
        point[static_cast<Eigen::Index>(axis)] =
            linear_value(table.mean[3 * row + axis], &table.shape[(3 * row + axis) * shape_size],
                         state.subspan(identity_begin, shape_size));
    return point;
}

std::vector<double> table_albedo(const VertexTable& table, std::span<const double> state) {
    return linear_model(table.mean_albedo, table.color, state.subspan(texture_begin, color_size));
}

namespace {

[[nodiscard]] Eigen::Vector3d point_at(std::span<const float> points, std::int32_t vertex) {
    return Eigen::Map<const Eigen::Vector3f>(&points[3 * static_cast<std::size_t>(vertex)])
        .cast<double>();
}

/// Unit vector in the frontal plane, perpendicular to the jaw line at landmark k and pointing away
/// from the face.
[[nodiscard]] Eigen::Vector3d outward_direction(const MorphableHead& head, std::size_t k) {
    const auto points = head.mean.values<float>();
    const Eigen::Vector3d before = point_at(points, head.landmarks[k == 0 ? 0 : k - 1]);
    const Eigen::Vector3d after =
        point_at(points, head.landmarks[std::min<std::size_t>(k + 1, 16)]);
    const Eigen::Vector2d tangent = (after - before).head<2>();
    const double length = std::max(tangent.norm(), 1e-9);
    // Landmarks 0 to 16 run down, right and up again: the face lies to their left.
    return {tangent[1] / length, -tangent[0] / length, 0.0};
}

/// The vertices that landmark k of the jaw may slide to, itself first. All in units of about a
/// decimetre.
[[nodiscard]] std::vector<std::int32_t> slide_vertices(const MorphableHead& head, std::size_t k,
                                                       const Eigen::Vector3d& outward) {
    constexpr double half_thickness = 0.02;
    constexpr double backwards = 0.02;
    constexpr double inwards = 0.35;  // stops short of the nose
    constexpr double outwards = 0.15;
    const auto points = head.mean.values<float>();
    const Eigen::Vector3d start = point_at(points, head.landmarks[k]);
    std::vector<std::int32_t> result{head.landmarks[k]};
    for (std::size_t vertex = 0; vertex < head.parts.size(); ++vertex) {
        if (head.parts[vertex] != HeadPart::skin) continue;
        const Eigen::Vector3d point = point_at(points, static_cast<std::int32_t>(vertex));
        const Eigen::Vector3d offset = point - start;
        const double out = offset.dot(outward);
        const double along = offset.x() * outward.y() - offset.y() * outward.x();
        if (std::abs(along) < half_thickness && out > -inwards && out < outwards &&
            offset.z() > -backwards)
            result.push_back(static_cast<std::int32_t>(vertex));
    }
    return result;
}

}  // namespace

Contour::Contour(const MorphableHead& head)
    : table_(head, [&] {
          std::vector<std::int32_t> vertices(head.landmarks.begin(), head.landmarks.end());
          for (std::size_t k = 0; k < slides_.size(); ++k) {
              const Eigen::Vector3d outward = outward_direction(head, k);
              const std::vector<std::int32_t> slide = slide_vertices(head, k, outward);
              slides_[k] = {vertices.size(), vertices.size() + slide.size(), outward};
              vertices.insert(vertices.end(), slide.begin(), slide.end());
          }
          return vertices;
      }()) {}

std::array<std::size_t, 68> Contour::rows(std::span<const double> points,
                                          const Camera& camera) const {
    std::array<std::size_t, 68> result{};
    for (std::size_t k = 0; k < result.size(); ++k) result[k] = k;
    for (std::size_t k = 0; k < slides_.size(); ++k) {
        const Eigen::Vector2d direction =
            (camera.world_from_camera.transpose() * slides_[k].outward).head<2>();
        double farthest = -1e300;
        for (std::size_t row = slides_[k].begin; row < slides_[k].end; ++row) {
            const Eigen::Vector3d seen =
                project(camera, Eigen::Map<const Eigen::Vector3d>(&points[3 * row]));
            const double out = seen.head<2>().dot(direction);
            if (out > farthest) {
                farthest = out;
                result[k] = row;
            }
        }
    }
    return result;
}

}  // namespace stymo::morphable
