#include "render/morphable/head_generator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/angle.h"
#include "render/morphable/skin_surface.h"

namespace stymo::morphable {

namespace {

constexpr double pi = std::numbers::pi;

/// A pseudo-random value in [-1, 1] that depends on the two arguments alone.
[[nodiscard]] double hash_noise(std::int64_t a, std::int64_t b) {
    std::uint32_t h =
        static_cast<std::uint32_t>(a) * 0x9E3779B1U ^ static_cast<std::uint32_t>(b) * 0x85EBCA77U;
    h = (h ^ (h >> 15)) * 0x2C1B3C6DU;
    h = (h ^ (h >> 12)) * 0x297A2D39U;
    h ^= h >> 15;
    return static_cast<double>(h) / 2147483647.5 - 1.0;
}

/// Piecewise smooth function of |angle| in degrees.
template <std::size_t count>
[[nodiscard]] double along(const std::array<std::array<double, 2>, count>& knots, double degrees) {
    for (std::size_t k = 0; k + 1 < count; ++k) {
        if (degrees <= knots[k + 1][0]) {
            return knots[k][1] + (knots[k + 1][1] - knots[k][1]) *
                                     smooth_step(knots[k][0], knots[k + 1][0], degrees);
        }
    }
    return knots[count - 1][1];
}

/// Rows of the eyeball: angle from its axis in degrees and colour. Each edge of a colour has two
/// rows close together.
struct EyeRing {
    double degrees;
    Eigen::Vector3d color;
};

const Eigen::Vector3d pupil{0.03, 0.03, 0.03};
const Eigen::Vector3d iris_dark{0.10, 0.08, 0.07};
const Eigen::Vector3d iris{0.38, 0.30, 0.22};
const Eigen::Vector3d white{0.93, 0.91, 0.89};
const std::array<EyeRing, 14> eye_rings{{{0.0, pupil},
                                         {5.0, pupil},
                                         {10.0, pupil},
                                         {11.0, iris},
                                         {15.0, iris},
                                         {19.0, iris},
                                         {22.0, iris},
                                         {23.0, iris_dark},
                                         {25.5, iris_dark},
                                         {26.5, white},
                                         {36.0, white},
                                         {50.0, {0.91, 0.88, 0.86}},
                                         {70.0, {0.86, 0.78, 0.75}},
                                         {100.0, {0.70, 0.50, 0.46}}}};

constexpr std::int64_t eye_columns = 24;

void add_eye(HeadMesh& mesh, const HeadParameters& p, double side) {
    const Eigen::Vector3d center = eye_center(p);
    for (const EyeRing& ring : eye_rings) {
        for (std::int64_t column = 0; column < eye_columns; ++column) {
            const double around =
                2.0 * pi * static_cast<double>(column) / static_cast<double>(eye_columns);
            const double polar = radians_from_degrees(ring.degrees);
            const Eigen::Vector3d local{std::sin(polar) * std::cos(around),
                                        std::sin(polar) * std::sin(around), std::cos(polar)};
            const double y = local[1] * std::cos(p.gaze_y) + local[2] * std::sin(p.gaze_y);
            const double z = local[2] * std::cos(p.gaze_y) - local[1] * std::sin(p.gaze_y);
            // Behind the lids the eyeball is smaller, so that it does not touch them.
            const double radius = eye_radius * (1.0 - 0.15 * smooth_step(60.0, 80.0, ring.degrees));
            const double x = local[0] * std::cos(p.gaze_x) + z * std::sin(p.gaze_x);
            mesh.add(
                {side * center[0] + radius * x, center[1] + radius * y,
                 center[2] + radius * (z * std::cos(p.gaze_x) - local[0] * std::sin(p.gaze_x))},
                ring.color, HeadPart::eyes);
        }
    }
    mesh.add_grid(static_cast<std::int64_t>(eye_rings.size()), eye_columns, true, true);
}

void add_brow(HeadMesh& mesh, const HeadParameters& p, double side) {
    constexpr std::int64_t rows = 6;
    constexpr std::int64_t brow_columns = 24;
    for (std::int64_t row = 0; row < rows; ++row) {
        for (std::int64_t column = 0; column < brow_columns; ++column) {
            const double along_brow =
                static_cast<double>(column) / static_cast<double>(brow_columns - 1);
            const double across =
                2.0 * static_cast<double>(row) / static_cast<double>(rows - 1) - 1.0;
            const double x = 0.115 + 0.375 * along_brow;
            const double width = p.brow_thickness *
                                 std::pow(std::max(0.0, 1.0 - along_brow), 0.45) *
                                 std::pow(smooth_step(-0.05, 0.18, along_brow), 0.5);
            const double middle =
                0.205 + p.brow_arch * std::sin(0.82 * pi * along_brow) - 0.02 * along_brow;
            Eigen::Vector3d point = face_point(side * x, middle + width * across, p);
            // Its rim lies under the skin, its back above it.
            point[2] += 0.022 * (1.0 - across * across) - 0.004;
            const double streak = 1.0 + 0.15 * hash_noise(column, row);
            mesh.add(point, streak * Eigen::Vector3d(0.235, 0.165, 0.12), HeadPart::brows);
        }
    }
    mesh.add_grid(rows, brow_columns, false, side < 0.0);
}

void add_ear(HeadMesh& mesh, const HeadParameters& p, double side) {
    constexpr std::int64_t rows = 13;
    constexpr std::int64_t ear_columns = 20;
    for (std::int64_t row = 0; row < rows; ++row) {
        for (std::int64_t column = 0; column < ear_columns; ++column) {
            const double polar = pi * static_cast<double>(row) / static_cast<double>(rows - 1);
            const double around =
                2.0 * pi * static_cast<double>(column) / static_cast<double>(ear_columns);
            const double across = std::sin(polar) * std::cos(around);
            const double up = std::sin(polar) * std::sin(around);
            const double out = std::cos(polar);
            const double shell =
                gauss(std::hypot(across - 0.10, 0.8 * up) / 0.55) * smooth_step(0.0, 0.6, out);
            const double narrowing = 1.0 + 0.25 * up;
            const double x = 0.085 * out - 0.085 * shell + 0.05 * up;
            const double z = -0.125 * across * narrowing - 0.035 * up;
            const double angle = 0.45 + p.ear_angle;
            const Eigen::Vector3d point{
                0.735 + p.ear_size * (x * std::cos(angle) - z * std::sin(angle)),
                -0.07 + p.ear_size * 0.245 * up,
                -0.11 + p.ear_size * (z * std::cos(angle) + x * std::sin(angle))};
            mesh.add({side * point[0], point[1], point[2]},
                     mix({0.77, 0.53, 0.44}, {0.50, 0.30, 0.25}, 0.8 * shell), HeadPart::ears);
        }
    }
    mesh.add_grid(rows, ear_columns, true, side > 0.0);
}

}  // namespace

void HeadMesh::add(const Eigen::Vector3d& vertex, const Eigen::Vector3d& color, HeadPart part,
                   double side) {
    vertices.push_back(vertex);
    albedo.push_back(color);
    parts.push_back(part);
    mouth_side.push_back(side);
}

void HeadMesh::add_grid(std::int64_t rows, std::int64_t columns, bool closed,
                        bool outward_is_left) {
    const auto first = static_cast<std::int64_t>(vertices.size()) - rows * columns;
    for (std::int64_t i = 0; i < rows * columns; ++i)
        grid_uv.emplace_back(
            static_cast<double>(i % columns) / double(closed ? columns : columns - 1),
            static_cast<double>(i / columns) / double(rows - 1));
    for (std::int64_t row = 0; row + 1 < rows; ++row) {
        for (std::int64_t column = 0; column < (closed ? columns : columns - 1); ++column) {
            const std::int64_t next = (column + 1) % columns;
            const auto a = static_cast<std::int32_t>(first + row * columns + column);
            const auto b = static_cast<std::int32_t>(first + row * columns + next);
            const auto c = static_cast<std::int32_t>(first + (row + 1) * columns + next);
            const auto d = static_cast<std::int32_t>(first + (row + 1) * columns + column);
            if (outward_is_left) {
                triangles.push_back({a, d, c});
                triangles.push_back({a, c, b});
            } else {
                triangles.push_back({a, c, d});
                triangles.push_back({a, b, c});
            }
        }
    }
}

void add_eyes(HeadMesh& mesh, const HeadParameters& parameters) {
    add_eye(mesh, parameters, -1.0);
    add_eye(mesh, parameters, 1.0);
}

void add_brows(HeadMesh& mesh, const HeadParameters& parameters) {
    add_brow(mesh, parameters, -1.0);
    add_brow(mesh, parameters, 1.0);
}

void add_ears(HeadMesh& mesh, const HeadParameters& parameters) {
    add_ear(mesh, parameters, -1.0);
    add_ear(mesh, parameters, 1.0);
}

void add_hair(HeadMesh& mesh, const HeadParameters& p) {
    constexpr std::int64_t rows = 32;
    constexpr std::int64_t hair_columns = 96;
    constexpr std::array<std::array<double, 2>, 8> line{{{0.0, 0.62},
                                                         {25.0, 0.59},
                                                         {48.0, 0.46},
                                                         {64.0, 0.20},
                                                         {76.0, 0.00},
                                                         {95.0, 0.12},
                                                         {120.0, -0.45},
                                                         {180.0, -0.66}}};
    const auto angle_of = [](std::int64_t column) {
        return 2.0 * pi * static_cast<double>(column) / static_cast<double>(hair_columns) - pi;
    };
    const auto front_of = [](double degrees) { return smooth_step(75.0, 30.0, degrees); };
    std::array<double, hair_columns> edges{};
    for (std::int64_t column = 0; column < hair_columns; ++column) {
        const double degrees = degrees_from_radians(std::abs(angle_of(column)));
        edges[static_cast<std::size_t>(column)] =
            profile_parameter(along(line, degrees) + front_of(degrees) * p.hairline);
    }
    for (std::int64_t row = 0; row < rows; ++row) {
        for (std::int64_t column = 0; column < hair_columns; ++column) {
            const double angle = angle_of(column);
            const double degrees = degrees_from_radians(std::abs(angle));
            const double depth = static_cast<double>(row) / static_cast<double>(rows - 1);
            const double front = front_of(degrees);
            const double edge = edges[static_cast<std::size_t>(column)];
            Eigen::Vector3d point = loft_point(edge * depth, angle);
            const double top = smooth_step(0.45, 0.85, point[1]);
            const double behind = smooth_step(60.0, 130.0, degrees);
            double thickness = p.hair_top * top +
                               (1.0 - top) * (p.hair_side + behind * (p.hair_back - p.hair_side));
            thickness += p.hair_fringe * front * gauss((depth - 0.80) / 0.25) *
                         (1.0 + 2.0 * p.hair_parting * std::sin(angle));
            thickness +=
                p.hair_wave * std::sin(11.0 * angle + 2.0 * depth) * smooth_step(0.2, 0.6, depth);
            // Rounds the rim, which ends just under the skin.
            thickness = thickness * std::sqrt(std::max(0.0, 1.0 - std::pow(depth, 10.0))) -
                        0.01 * std::pow(depth, 10.0);
            const Eigen::Vector3d outward{point[0] / 0.55, (point[1] - 0.15) / 1.0,
                                          (point[2] + 0.1) / 0.9};
            point += thickness * outward.normalized();
            const double hanging =
                smooth_step(0.55, 1.0, depth) * smooth_step(70.0, 100.0, degrees);
            point[1] -= p.hair_length * hanging;
            point[0] += 0.25 * p.hair_length * hanging * std::sin(angle);
            const double streak = 1.0 + 0.13 * hash_noise(column, row / 5) +
                                  0.10 * std::sin(11.0 * angle + 2.0 * depth + 1.0);
            const double shade = streak * (1.0 - 0.25 * smooth_step(0.85, 1.0, depth));
            mesh.add(point, shade * hair_color, HeadPart::hair);
        }
    }
    mesh.add_grid(rows, hair_columns, true, true);
}

HeadMesh generate_head(const HeadParameters& parameters) {
    HeadMesh mesh;
    add_skin(mesh, parameters);
    add_eyes(mesh, parameters);
    add_brows(mesh, parameters);
    add_ears(mesh, parameters);
    add_hair(mesh, parameters);
    return mesh;
}

}  // namespace stymo::morphable
