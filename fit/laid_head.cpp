#include "fit/laid_head.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <opencv2/imgproc.hpp>

#include "core/angle.h"
#include "core/error.h"
#include "core/median.h"
#include "core/parallel.h"
#include "core/tensor_eigen.h"
#include "fit/morphable/morphable_fit.h"
#include "fit/photo/landmarks.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/pixel_depth.h"
#include "nn/realtime/view_range.h"
#include "render/depth_map.h"
#include "render/morphable/face_surface.h"
#include "render/rasterizer.h"
#include "render/triangle_mesh.h"

namespace stymo {

namespace {

using Vector = Eigen::Vector3d;
using Points = std::vector<Vector>;

/// Landmarks on the skin: those of the jaw are on an outline, the inner lips on a fold.
constexpr std::size_t first_landmark = 17, end_of_landmarks = 60;
constexpr double least_cosine = 0.25;  ///< of surfaces whose depth counts
constexpr double outline_weight = 2.0;
/// A surface farther from the head than this, in world units, is not the head's.
constexpr double farthest = 0.3;
/// A vertex may lie this far behind the depth buffer and still be visible.
constexpr double visible_tolerance = 0.02;

Points points_of(const Tensor& vertices) {
    Points points(static_cast<std::size_t>(vertices.shape(0)));
    for (std::size_t i = 0; i < points.size(); ++i)
        points[i] = matrix_map<float>(vertices)
                        .row(static_cast<Eigen::Index>(i))
                        .transpose()
                        .cast<double>();
    return points;
}

Tensor tensor_of(const Points& points) {
    Tensor vertices({std::ssize(points), 3});
    auto rows = mutable_matrix_map<float>(vertices);
    for (std::size_t i = 0; i < points.size(); ++i)
        rows.row(static_cast<Eigen::Index>(i)) = points[i].transpose().cast<float>();
    return vertices;
}

/// In units of the image's side, positive inside: distance of each pixel of a depth map from the
/// outline of what it shows.
cv::Mat signed_distance(const Tensor& depth) {
    const auto side = static_cast<int>(depth.shape(0));
    cv::Mat inside(side, side, CV_8U), within, beyond;
    for (int i = 0; i < side * side; ++i)
        inside.data[i] =
            std::isfinite(depth.values<float>()[static_cast<std::size_t>(i)]) ? 255 : 0;
    cv::distanceTransform(inside, within, cv::DIST_L2, 5);
    cv::distanceTransform(255 - inside, beyond, cv::DIST_L2, 5);
    return (within - beyond) / side;
}

/// What pulls at the vertices: each has a quadratic cost, d^T matrix d / 2 - vector . d, of its
/// displacement d from where the fitted head has it.
struct Pull {
    std::vector<Eigen::Matrix3d> matrix;
    Points vector;

    explicit Pull(std::size_t count)
        : matrix(count, Eigen::Matrix3d::Zero()), vector(count, Vector::Zero()) {}
    /// Draws the component of `displacement` along the unit vector `along` to `to`.
    void add(std::size_t vertex, const Vector& along, double to, double weight) {
        matrix[vertex] += weight * along * along.transpose();
        vector[vertex] += weight * to * along;
    }
};

/// Vertices that move alike.
struct Neighbour {
    std::size_t vertex;
    double weight;
};

class Laying {
public:
    Laying(const MorphableHead& head, const Tensor& vertices)
        : head_(head),
          start_(points_of(vertices)),
          displacement_(start_.size(), Vector::Zero()),
          area_(start_.size(), 0.0),
          neighbours_(start_.size()) {
        for (const auto& [a, b, c] : head.triangles) {
            const Vector& corner = start_[std::size_t(a)];
            const double area =
                0.5 *
                (start_[std::size_t(b)] - corner).cross(start_[std::size_t(c)] - corner).norm();
            for (const std::int32_t vertex : {a, b, c}) area_[std::size_t(vertex)] += area / 3.0;
            for (const auto& [from, to] : {std::pair{a, b}, {b, c}, {c, a}}) {
                neighbours_[std::size_t(from)].push_back({std::size_t(to), 1.0});
                neighbours_[std::size_t(to)].push_back({std::size_t(from), 1.0});
            }
        }
        link_pieces();
    }

    [[nodiscard]] Points points() const {
        Points points = start_;
        for (std::size_t i = 0; i < points.size(); ++i) points[i] += displacement_[i];
        return points;
    }

    void step(std::span<const SeenFace> views, const Landmarks& landmarks, double length) {
        view_weight_ = 1.0 / static_cast<double>(views.size());
        Pull pull(start_.size());
        const Tensor vertices = tensor_of(points());
        const Tensor normals = vertex_normals(vertices, head_.triangles);
        for (const SeenFace& view : views) add_view(view, vertices, normals, pull);
        add_landmarks(views.front(), landmarks, pull);
        solve(pull, length);
    }

private:
    [[nodiscard]] bool follows(std::size_t vertex) const {
        return head_.parts[vertex] == HeadPart::eyes || head_.parts[vertex] == HeadPart::mouth;
    }

    /// Smaller pieces follow the nearest vertices of the largest one.
    void link_pieces() {
        const std::vector<std::int32_t> piece = pieces_of(std::ssize(start_), head_.triangles);
        std::map<std::int32_t, std::vector<std::size_t>> pieces;
        for (std::size_t i = 0; i < piece.size(); ++i)
            if (!neighbours_[i].empty()) pieces[piece[i]].push_back(i);
        const auto& largest = std::ranges::max_element(pieces, {}, [](const auto& entry) {
                                  return entry.second.size();
                              })->second;
        constexpr double link = 0.05;
        for (const auto& [key, members] : pieces) {
            if (&members == &largest) continue;
            const std::size_t first = members.front();
            const bool rigid = follows(first);
            if (rigid) {
                // All teeth move as one, and each eye with its shells.
                const int side = head_.parts[first] != HeadPart::eyes ? 0
                                 : start_[first][0] > 0.0             ? 1
                                                                      : 2;
                std::ranges::copy(members, std::back_inserter(rigid_[std::size_t(side)]));
            }
            for (const std::size_t vertex : members) {
                std::size_t nearest = largest.front();
                double best = std::numeric_limits<double>::infinity();
                for (const std::size_t other : largest) {
                    const double distance = (start_[other] - start_[vertex]).squaredNorm();
                    if (distance < best) best = distance, nearest = other;
                }
                if (rigid) neighbours_[vertex].clear();
                neighbours_[vertex].push_back({nearest, link});
            }
        }
    }

    void add_view(const SeenFace& view, const Tensor& vertices, const Tensor& normals,
                  Pull& pull) const {
        constexpr std::int64_t buffer_side = 256;
        const RasterImage buffer = rasterize(vertices, vertices, head_.triangles, view.camera,
                                             {buffer_side, buffer_side, 1});
        const cv::Mat outline = signed_distance(view.depth);
        parallel_for(std::ssize(start_), 1024, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) {
                const auto vertex = static_cast<std::size_t>(i);
                if (follows(vertex) || neighbours_[vertex].empty()) continue;
                const Vector point = matrix_map<float>(vertices).row(i).transpose().cast<double>();
                const Vector seen = project(view.camera, point);
                if (seen.head<2>().minCoeff() <= 0.0 || seen.head<2>().maxCoeff() >= 1.0) continue;
                const auto pixel = [&](double side) {
                    return cv::Point(int(seen[0] * side), int(seen[1] * side));
                };
                const cv::Point at = pixel(buffer_side);
                const double nearest =
                    buffer.depth.values<float>()[std::size_t(at.y * buffer_side + at.x)];
                if (seen[2] > nearest + visible_tolerance && std::isfinite(nearest)) continue;
                const Vector normal = matrix_map<float>(normals).row(i).transpose().cast<double>();
                pull_in_view(view, outline.at<float>(pixel(outline.cols)), vertex, point, normal,
                             pull);
            }
        });
    }

    /// `inside` is the signed distance of the vertex from the view's outline.
    void pull_in_view(const SeenFace& view, double inside, std::size_t vertex, const Vector& point,
                      const Vector& normal, Pull& pull) const {
        const Vector sight = point - view.camera.center;
        const double distance = sight.norm();
        const Vector along = sight / distance;
        const double cosine = -along.dot(normal);
        const Vector& moved = displacement_[vertex];
        if (cosine > least_cosine) {
            const Vector seen = project(view.camera, point);
            const double difference = depth_at(view.depth, seen.head<2>()) - distance;
            if (std::abs(difference) < farthest)
                pull.add(vertex, along, moved.dot(along) + difference,
                         area_[vertex] * cosine * cosine * view_weight_);
        }
        constexpr double edge_on = 0.35;
        if (std::abs(cosine) >= edge_on) return;
        const Vector outwards = (normal + cosine * along).normalized();
        const double shift = inside * distance / view.camera.intrinsics.focal;
        if (std::abs(shift) < farthest)
            pull.add(
                vertex, outwards, moved.dot(outwards) + shift,
                area_[vertex] * outline_weight * (1.0 - std::abs(cosine) / edge_on) * view_weight_);
    }

    void add_landmarks(const SeenFace& view, const Landmarks& landmarks, Pull& pull) const {
        // As much as a patch of a square centimetre that every view sees.
        constexpr double weight = 0.015;
        for (std::size_t k = first_landmark; k < end_of_landmarks; ++k) {
            const auto vertex = static_cast<std::size_t>(head_.landmarks[k]);
            const Vector to = point_at(view.camera, view.depth, landmarks[k]);
            if (!to.allFinite() || (to - start_[vertex]).norm() > farthest) continue;
            for (int axis = 0; axis < 3; ++axis)
                pull.add(vertex, Vector::Unit(axis), to[axis] - start_[vertex][axis], weight);
        }
    }

    /// Successive over-relaxation of cost + length^2 * (differences between neighbours)^2:
    /// displacements change over about this length.
    void solve(const Pull& pull, double length) {
        const double smoothness = length * length;
        constexpr int sweeps = 200;
        constexpr double relaxation = 1.9;
        std::vector<Eigen::Matrix3d> inverse(start_.size());
        for (std::size_t i = 0; i < start_.size(); ++i) {
            double sum = 1e-12;
            for (const Neighbour& other : neighbours_[i]) sum += smoothness * other.weight;
            inverse[i] = (pull.matrix[i] + sum * Eigen::Matrix3d::Identity()).inverse();
        }
        for (int sweep = 0; sweep < sweeps; ++sweep)
            for (std::size_t i = 0; i < start_.size(); ++i) {
                Vector right = pull.vector[i];
                for (const Neighbour& other : neighbours_[i])
                    right += smoothness * other.weight * displacement_[other.vertex];
                displacement_[i] += relaxation * (inverse[i] * right - displacement_[i]);
            }
        for (const std::vector<std::size_t>& piece : rigid_) {
            Vector mean = Vector::Zero();
            for (const std::size_t vertex : piece) mean += displacement_[vertex];
            for (const std::size_t vertex : piece)
                displacement_[vertex] = mean / static_cast<double>(piece.size());
        }
    }

    const MorphableHead& head_;
    Points start_, displacement_;
    double view_weight_ = 1.0;  ///< of each view, so that all together have 1
    std::vector<double> area_;  ///< of the surface that a vertex stands for
    std::vector<std::vector<Neighbour>> neighbours_;
    std::array<std::vector<std::size_t>, 3> rigid_;  ///< vertices that keep their shape
};

/// Throws ValueError unless most of the face in a frontal view has a depth.
void require_surface(const SeenFace& frontal) {
    const FaceSquare face = square_around(mean_face_landmarks(frontal.camera, 1));
    double seen = 0.0;
    for (const double u : {-0.4, 0.0, 0.4})
        for (const double v : {-0.4, 0.0, 0.4})
            seen += std::isfinite(depth_at(frontal.depth, face.point({u, v}))) ? 1.0 : 0.0;
    if (seen < 5.0)
        fail<ValueError>("this face has no surface: more than half of the light passes through it");
}

}  // namespace

std::vector<SeenFace> surface_views(const Model& model, const Codes& codes, double largest_yaw,
                                    int yaws, bool around_head,
                                    const std::function<void(double)>& observe) {
    FaceRenderer images(model, {.mode = RenderMode::exact, .mask = true, .remove_floaters = true});
    FaceRenderer depths(model,
                        {.mode = model.decoder().folds() ? RenderMode::skip : RenderMode::exact,
                         .tolerance = 0.01,
                         .depth = true,
                         .remove_floaters = true});
    images.show(codes);
    depths.show(codes);
    const std::int64_t rays = model.decoder().rays_per_side();
    constexpr std::int64_t least_side = 128;
    const std::int64_t side = rays * std::max<std::int64_t>(least_side / rays, 1);
    std::vector<Camera> cameras{model_camera(model, 0.0, 0.0, 0.0)};
    const ViewRange range{.camera = model.config().camera,
                          .yaw = largest_yaw,
                          .pitch = 0.2,
                          .around_head = around_head};
    for (const Camera& camera : cameras_over(range, yaws, 3)) cameras.push_back(camera);
    std::vector<SeenFace> views;
    for (const Camera& camera : cameras) {
        View view = images.render(camera);
        views.push_back({camera, std::move(view.image), std::move(view.mask),
                         pixel_depth(depths, camera, rays, side)});
        if (views.size() == 1) require_surface(views.front());
        if (observe)
            observe(static_cast<double>(views.size()) / static_cast<double>(cameras.size()));
    }
    return views;
}

LaidHead fitted_head(const MorphableHead& head, const LandmarkModel& landmarks,
                     const SeenFace& frontal) {
    const std::int64_t side = frontal.image.shape(0);
    const Landmarks points = find_points(landmarks, frontal.image,
                                         square_around(mean_face_landmarks(frontal.camera, side)));
    const Intrinsics& intrinsics = frontal.camera.intrinsics;
    const MorphableFitTarget target{points, frontal.image, frontal.mask};
    const MorphableFit fit = fit_morphable(head, {&target, 1}, intrinsics).front();
    constexpr double largest_error = 0.05;
    if (!(fit.landmark_error < largest_error))
        fail<ValueError>("the frontal view does not look like a face: no head fits its landmarks");
    const Camera camera = camera_from_pose(fit.pose, intrinsics);
    const Eigen::Matrix3d turn =
        frontal.camera.world_from_camera * camera.world_from_camera.transpose();
    Points vertices = points_of(head_vertices(head, fit.identity, fit.expression));
    for (Vector& vertex : vertices)
        vertex = turn * (vertex - camera.center) + frontal.camera.center;
    // Scaled about the camera the head looks the same, at another depth.
    const FaceSurface surface =
        face_surface(head, tensor_of(vertices), frontal.camera, frontal.depth.shape(0));
    std::vector<double> ratios;
    for (std::int64_t i = 0; i < surface.face.size(); ++i) {
        const auto pixel = static_cast<std::size_t>(i);
        const float expected = surface.depth.values<float>()[pixel];
        if (surface.face.values<float>()[pixel] > 0.0F)
            ratios.push_back(double{frontal.depth.values<float>()[pixel]} / double{expected});
    }
    const double scale = ratios.empty() ? 1.0 : median(std::move(ratios));
    if (!std::isfinite(scale)) fail<ValueError>("this face has no surface");
    for (Vector& vertex : vertices)
        vertex = frontal.camera.center + scale * (vertex - frontal.camera.center);
    return {tensor_of(vertices), fit.identity, fit.expression, scale * turn,
            scaled_landmarks(points, 1.0 / static_cast<double>(side))};
}

void lay_on_surface(const MorphableHead& head, std::span<const SeenFace> views, LaidHead& laid) {
    Laying laying(head, laid.vertices);
    // From stiff to soft, so that vertices find their positions before details form.
    for (const double length : {0.4, 0.28, 0.2, 0.14, 0.1, 0.07, 0.06, 0.06})
        laying.step(views, laid.landmarks, length);
    Points points = laying.points();
    // The built-in head's lids close along straight lines, which cut through its eyeballs.
    constexpr double deeper = 0.02;
    for (std::size_t i = 0; i < points.size() && head.grid_uv.defined(); ++i)
        if (head.parts[i] == HeadPart::eyes) points[i] -= deeper * laid.world_from_head.col(2);
    laid.vertices = tensor_of(points);
}

Tensor neutral_vertices(const MorphableHead& head, const LaidHead& laid) {
    const Tensor shown = head_vertices(head, laid.identity, laid.expression);
    const Tensor at_rest = head_vertices(head, laid.identity, std::vector<float>(79));
    Tensor vertices = laid.vertices;
    mutable_matrix_map<float>(vertices) -= (matrix_map<float>(shown) - matrix_map<float>(at_rest)) *
                                           laid.world_from_head.transpose().cast<float>();
    return vertices;
}

}  // namespace stymo
