#include "train/landmarks/head_pictures.h"

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "render/camera.h"
#include "render/rasterizer.h"
#include "train/landmarks/portrait_parts.h"
#include "train/landmarks/random.h"

namespace stymo {
namespace {

/// Scanned heads store a quarter of a shape's full strength (scanned_head.cpp).
constexpr double full_strength = 4.0;
/// Side of the box around the points, in units of the image's.
constexpr double box_share = 0.5;

/// Offset from the scan's vertex to the position at which people mark a point and its mirror image:
/// away from the middle of the face and up, in units of the distance of the outer corners of the
/// eyes.
struct Correction {
    std::size_t point;
    double outwards;
    double up;
};
/// The corrections are for the head of ICT-FaceKit, which is recognised by its number of vertices.
/// They were measured on six portraits that were marked by hand (docs/landmarks.md).
constexpr std::int64_t corrected_vertex_count = 26719;
constexpr std::array<Correction, 22> corrections{{
    {6, 0.0, -0.016},     {7, 0.0, -0.032},    {8, 0.0, -0.032},    {17, -0.035, -0.034},
    {18, -0.022, -0.044}, {19, -0.01, -0.055}, {20, 0.003, -0.065}, {21, 0.015, -0.075},
    {30, 0.0, -0.016},    {31, 0.0, 0.018},    {32, 0.0, 0.018},    {33, 0.0, 0.018},
    {36, 0.04, 0.024},    {39, -0.04, 0.038},  {48, 0.024, 0.013},  {49, 0.0, -0.02},
    {50, 0.0, -0.04},     {51, 0.0, -0.04},    {57, 0.0, 0.039},    {58, 0.0, 0.039},
    {59, 0.0, 0.02},      {60, 0.012, 0.006},
}};

/// Where people mark the head's points, in world coordinates.
[[nodiscard]] std::array<Eigen::Vector3d, 68> marked_places(const MorphableHead& head,
                                                            std::span<const float> vertices) {
    std::array<Eigen::Vector3d, 68> places;
    for (std::size_t k = 0; k < places.size(); ++k)
        places[k] = Eigen::Map<const Eigen::Vector3f>(
                        &vertices[3 * static_cast<std::size_t>(head.landmarks[k])])
                        .cast<double>();
    if (head.vertex_count() != corrected_vertex_count) return places;
    const double unit = (places[45] - places[36]).norm();
    const auto move = [&](std::size_t k, double right, double up) {
        places[k] += unit * Eigen::Vector3d(right, up, 0.0);
    };
    for (const auto& [point, outwards, up] : corrections) {
        move(point, -outwards, up);
        if (mirrored_point(point) != point) move(mirrored_point(point), outwards, up);
    }
    return places;
}

using Motion = std::array<Eigen::Vector3d, 68>;

/// Effect of a row of the expression basis on the landmarks.
[[nodiscard]] Motion landmark_motion(const MorphableHead& head, std::size_t row) {
    const auto values = head.expression.values<float>();
    Motion motion;
    for (std::size_t k = 0; k < motion.size(); ++k) {
        const auto at = 3 * (static_cast<std::size_t>(head.vertex_count()) * row +
                             static_cast<std::size_t>(head.landmarks[k]));
        motion[k] = Eigen::Map<const Eigen::Vector3f>(&values[at]).cast<double>();
    }
    return motion;
}

[[nodiscard]] double agreement(const Motion& a, const Motion& mirrored) {
    double product = 0.0, a_squared = 1e-12, b_squared = 1e-12;
    for (std::size_t k = 0; k < a.size(); ++k) {
        const Eigen::Vector3d& other = mirrored[mirrored_point(k)];
        const Eigen::Vector3d b(-other.x(), other.y(), other.z());
        product += a[k].dot(b);
        a_squared += a[k].squaredNorm();
        b_squared += b.squaredNorm();
    }
    return product / std::sqrt(a_squared * b_squared);
}

/// The `count` rows with the highest scores.
template <class Score>
[[nodiscard]] std::vector<std::size_t> best_rows(const std::vector<Motion>& motions,
                                                 std::size_t count, const Score& score) {
    std::vector<std::size_t> rows(motions.size());
    for (std::size_t row = 0; row < rows.size(); ++row) rows[row] = row;
    std::ranges::stable_sort(
        rows, [&](std::size_t a, std::size_t b) { return score(motions[a]) > score(motions[b]); });
    rows.resize(std::min(count, rows.size()));
    return rows;
}

/// Colours under an ambient light and some lamps, with a little gloss.
[[nodiscard]] Tensor lit(const Tensor& albedo, const Tensor& normals, const Camera& camera,
                         Rng rng) {
    struct Lamp {
        Eigen::Vector3d direction;
        Eigen::Vector3d color;
    };
    const auto tint = [&](double deviation) {
        return Eigen::Vector3d(1.0 + deviation * rng.normal(), 1.0, 1.0 + deviation * rng.normal());
    };
    const Eigen::Vector3d ambient = between(rng, 0.3, 0.85) * tint(0.04);
    std::vector<Lamp> lamps;
    const std::int64_t count = 1 + rng.below(3);
    for (std::int64_t k = 0; k < count; ++k) {
        // Camera axes: x right, y down, z forward. Most lamps are above and in front.
        const Eigen::Vector3d direction(rng.normal(), 0.7 * rng.normal() - 0.5,
                                        -std::abs(rng.normal()) - 0.2);
        const double strength = between(rng, 0.2, 1.0) / static_cast<double>(count);
        lamps.push_back({direction.normalized(), strength * tint(0.06)});
    }
    const double gloss = between(rng, 0.0, 0.25);
    const double from_above = between(rng, 0.0, 0.25);
    Tensor result = albedo;
    const auto colors = result.mutable_values<float>();
    const auto normal_values = normals.values<float>();
    const Eigen::Matrix3d camera_from_world = camera.world_from_camera.transpose();
    for (std::size_t at = 0; at < colors.size(); at += 3) {
        const Eigen::Vector3d normal =
            camera_from_world *
            Eigen::Map<const Eigen::Vector3f>(&normal_values[at]).cast<double>();
        Eigen::Vector3d light = ambient * (1.0 - from_above * normal.y());
        double shine = 0.0;
        for (const Lamp& lamp : lamps) {
            light += std::max(0.0, normal.dot(lamp.direction)) * lamp.color;
            const Eigen::Vector3d half = (lamp.direction - Eigen::Vector3d::UnitZ()).normalized();
            shine += std::pow(std::max(0.0, normal.dot(half)), 20.0) * lamp.color.y();
        }
        for (int k = 0; k < 3; ++k) {
            float& value = colors[at + static_cast<std::size_t>(k)];
            value = std::clamp(static_cast<float>(value * light[k] + gloss * shine), 0.01F, 1.0F);
        }
    }
    return result;
}

/// A camera turned by random angles, with the points in the middle of the image.
[[nodiscard]] Camera random_camera(const MorphableHead& head, std::span<const float> vertices,
                                   Rng& rng) {
    const double yaw = chance(rng, 0.7) ? limited_normal(rng, 15.0, 50.0) : between(rng, -50., 50.);
    const double pitch = limited_normal(rng, 9.0, 30.0);
    const double roll = limited_normal(rng, 4.0, 12.0);
    const double distance = between(rng, 4.5, 12.0);
    Camera camera =
        camera_from_pose(orbit_pose(radians_from_degrees(yaw), radians_from_degrees(pitch),
                                    radians_from_degrees(roll), distance),
                         {1.0, 0.0, 0.0});
    Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
    for (const std::int32_t vertex : head.landmarks) {
        const Eigen::Map<const Eigen::Vector3f> point(
            &vertices[3 * static_cast<std::size_t>(vertex)]);
        const Eigen::Vector2d at = project(camera, point.cast<double>()).head<2>();
        low = low.cwiseMin(at);
        high = high.cwiseMax(at);
    }
    const double focal = box_share / (high - low).maxCoeff();
    const Eigen::Vector2d middle = 0.5 * (low + high);
    camera.intrinsics = {focal, 0.5 - focal * middle.x(), 0.5 - focal * middle.y()};
    return camera;
}

[[nodiscard]] Tensor with_coverage(const RasterImage& raster) {
    Tensor image({HeadPictures::side, HeadPictures::side, 4});
    const auto color = raster.color.values<float>();
    const auto coverage = raster.coverage.values<float>();
    const auto values = image.mutable_values<float>();
    for (std::size_t pixel = 0; pixel < coverage.size(); ++pixel) {
        for (std::size_t k = 0; k < 3; ++k) values[4 * pixel + k] = color[3 * pixel + k];
        values[4 * pixel + 3] = coverage[pixel];
    }
    return image;
}

}  // namespace

HeadPictures::HeadPictures(const MorphableHead& head)
    : head_(head), paint_(head), used_(MorphableHead::expression_size) {
    std::vector<Motion> motions;
    for (std::size_t row = 0; row < used_.size(); ++row) {
        motions.push_back(landmark_motion(head, row));
        double most = 0.0;
        for (const Eigen::Vector3d& move : motions.back()) most = std::max(most, move.norm());
        used_[row] = most > 1e-4;
    }
    for (std::size_t row = 0; row < used_.size(); ++row) {
        mirrored_[row] = row;
        double best = 0.8;
        for (std::size_t other = 0; other < used_.size(); ++other) {
            const double found = used_[row] ? agreement(motions[row], motions[other]) : 0.0;
            if (other != row && found > best) {
                best = found;
                mirrored_[row] = other;
            }
        }
    }
    smiles_ = best_rows(motions, 2, [](const Motion& m) {
        return std::max(m[48].y() - m[48].x(), m[54].y() + m[54].x());
    });
    teeth_ = best_rows(motions, 4, [](const Motion& m) {
        return std::max(std::max(m[61].y(), m[63].y()) - std::max(0.0, m[8].norm()),
                        -std::min(m[65].y(), m[67].y()) - 2.0 * m[8].norm());
    });
    blinks_ = best_rows(motions, 2, [](const Motion& m) {
        return std::max(m[41].y() - m[37].y(), m[46].y() - m[44].y());
    });
    const auto mean = head.mean.values<float>();
    const auto place = [&](std::int32_t vertex) {
        return Eigen::Map<const Eigen::Vector3f>(&mean[3 * static_cast<std::size_t>(vertex)]);
    };
    for (std::size_t k = 0; k < outline_.size(); ++k) {
        if (k >= 7 && k <= 9) continue;  // the chin hides nothing
        const Eigen::Vector3f jaw = place(head.landmarks[k]);
        for (std::int32_t vertex = 0; vertex < head.vertex_count(); ++vertex) {
            if (head.parts[static_cast<std::size_t>(vertex)] != HeadPart::skin) continue;
            const Eigen::Vector3f point = place(vertex);
            if (std::abs(point.y() - jaw.y()) < 0.02F && point.z() > jaw.z() &&
                point.x() * jaw.x() > 0.0F && std::abs(point.x()) < std::abs(jaw.x()) + 0.02F)
                outline_[k].push_back(vertex);
        }
    }
}

std::vector<float> HeadPictures::expression(Rng& rng) const {
    std::vector<double> strength(used_.size(), 0.0);
    const double often = between(rng, 0.0, 0.2);
    for (std::size_t row = 0; row < strength.size(); ++row) {
        if (!used_[row] || !chance(rng, often)) continue;
        strength[row] = between(rng, 0.0, 0.6);
        if (chance(rng, 0.75)) strength[mirrored_[row]] = strength[row];
    }
    for (const std::size_t row : blinks_)
        if (chance(rng, 0.8)) strength[row] = std::min(strength[row], 0.2);
    if (chance(rng, 0.6)) {
        const double smile = between(rng, 0.2, 0.9);
        for (const std::size_t row : smiles_) strength[row] = smile * (1.0 + 0.1 * rng.normal());
        if (chance(rng, 0.65)) {
            const double parted = between(rng, 0.1, 0.6);
            for (const std::size_t row : teeth_)
                strength[row] = std::max(strength[row], parted * between(rng, 0.7, 1.2));
        }
    }
    std::vector<float> code(strength.size(), 0.0F);
    for (std::size_t row = 0; row < code.size(); ++row)
        code[row] = static_cast<float>(full_strength * strength[row] *
                                       (head_.one_sided[row] || chance(rng, 0.5) ? 1.0 : -1.0));
    return code;
}

void HeadPictures::move_jaw_to_outline(FacePoints& points, const Camera& camera,
                                       std::span<const float> vertices) const {
    const Eigen::Vector2d across = (points[42] + points[45] - points[36] - points[39]).normalized();
    for (std::size_t k = 0; k < outline_.size(); ++k) {
        const double outwards = k < 8 ? -1.0 : 1.0;
        const Eigen::Vector2d start = points[k];
        double farthest = 0.0;
        for (const std::int32_t vertex : outline_[k]) {
            const Eigen::Map<const Eigen::Vector3f> point(
                &vertices[3 * static_cast<std::size_t>(vertex)]);
            const Eigen::Vector2d at =
                static_cast<double>(side) * project(camera, point.cast<double>()).head<2>();
            const double distance = outwards * (at - start).dot(across);
            if (distance <= farthest) continue;
            farthest = distance;
            points[k] = at;
        }
    }
}

LandmarkExample HeadPictures::draw(Rng rng) const {
    Rng draws = rng.split("head");
    std::vector<float> identity(MorphableHead::identity_size);
    for (float& value : identity) value = static_cast<float>(limited_normal(draws, 1.0, 2.5));
    const Tensor vertices = head_vertices(head_, identity, expression(draws));
    const auto vertex_values = vertices.values<float>();
    const Camera camera = random_camera(head_, vertex_values, draws);
    const Tensor colors =
        lit(paint_.draw(rng.split("paint")), vertex_normals(vertices, head_.triangles), camera,
            rng.split("light"));
    LandmarkExample example;
    example.image =
        with_coverage(rasterize(vertices, colors, head_.triangles, camera, {side, side, 2}));
    example.weights.fill(1.0F);
    const std::array<Eigen::Vector3d, 68> places = marked_places(head_, vertex_values);
    for (std::size_t k = 0; k < places.size(); ++k)
        example.points[k] = static_cast<double>(side) * project(camera, places[k]).head<2>();
    move_jaw_to_outline(example.points, camera, vertex_values);
    draw_portrait_parts(example, rng.split("parts"));
    return example;
}

}  // namespace stymo
