#include "render/morphable/builtin_head.h"

#include <cmath>
#include <limits>

#include "core/angle.h"
#include "render/morphable/displacement.h"
#include "render/morphable/skin_surface.h"

namespace stymo::morphable {

namespace {

struct Target {
    Eigen::Vector3d point;
    bool lips = false;
    bool flat = false;  ///< nearest in x and y alone: along the edges of lids and lips, whose depth
                        ///< the opening changes
};

[[nodiscard]] std::int32_t nearest_vertex(const HeadMesh& mesh, const Target& target) {
    double best = std::numeric_limits<double>::infinity();
    std::int32_t result = 0;
    for (std::size_t vertex = 0; vertex < mesh.vertices.size(); ++vertex) {
        const HeadPart part = mesh.parts[vertex];
        if (part != HeadPart::lips && (part != HeadPart::skin || target.lips)) continue;
        const Eigen::Vector3d& point = mesh.vertices[vertex];
        if (target.flat && point[2] < 0.4) continue;
        const Eigen::Vector3d difference = point - target.point;
        const double distance = target.flat ? difference.head<2>().norm() : difference.norm();
        if (distance < best) {
            best = distance;
            result = static_cast<std::int32_t>(vertex);
        }
    }
    return result;
}

void add_jaw(std::vector<Target>& targets) {
    constexpr std::array<double, 9> height{0.05,  -0.13, -0.31, -0.48, -0.62,
                                           -0.74, -0.83, -0.89, -0.905};
    constexpr std::array<double, 9> degrees{84.0, 83.0, 82.0, 79.0, 72.0, 60.0, 44.0, 23.0, 0.0};
    for (int k = -8; k <= 8; ++k) {
        const auto index = static_cast<std::size_t>(8 - std::abs(k));
        const double angle = radians_from_degrees(degrees[index]);
        targets.push_back({loft_point(profile_parameter(height[index]), k < 0 ? -angle : angle)});
    }
}

void add_eye(std::vector<Target>& targets, const HeadParameters& p, double side) {
    const double w = p.eye_width;
    // Corners lie tilted against each other; the lids' points are a third of the width from the
    // middle.
    const std::array<std::array<double, 2>, 6> outer_first{{{w, 1.3 * p.eye_tilt * w},
                                                            {0.36 * w, 0.95 * p.upper_lid},
                                                            {-0.36 * w, 0.95 * p.upper_lid},
                                                            {-w, -1.3 * p.eye_tilt * w},
                                                            {-0.36 * w, -0.95 * p.lower_lid},
                                                            {0.36 * w, -0.95 * p.lower_lid}}};
    // At the image's right the first point is the inner corner.
    constexpr std::array<std::size_t, 6> inner_first{3, 2, 1, 0, 5, 4};
    for (std::size_t k = 0; k < 6; ++k) {
        const auto& [x, y] = outer_first[side < 0.0 ? k : inner_first[k]];
        targets.push_back({{side * (eye_spacing + x), eye_height + y, 0.0}, false, true});
    }
}

void add_lips(std::vector<Target>& targets, const HeadParameters& p) {
    const double w = p.mouth_width;
    const auto at = [&](double x, double y) {
        targets.push_back({{x * w, mouth_height + y, 0.0}, true, true});
    };
    at(-0.96, 0.0);
    for (const double x : {-0.62, -0.25, 0.0, 0.25, 0.62})
        at(x, p.upper_lip * std::pow(1.0 - x * x, 0.8) * (x == 0.0 ? 0.78 : 1.0));
    at(0.96, 0.0);
    for (const double x : {0.62, 0.27, 0.0, -0.27, -0.62})
        at(x, -p.lower_lip * std::pow(1.0 - x * x, 0.6));
    at(-0.86, 0.0);
    for (const double x : {-0.27, 0.0, 0.27}) at(x, 0.004 - p.mouth_curve);
    at(0.86, 0.0);
    for (const double x : {0.27, 0.0, -0.27}) at(x, -0.004 - p.mouth_curve);
}

/// The vertices of the generated head that are nearest to dlib's 68 landmarks: jaw 0-16, brows
/// 17-26, nose 27-35, eyes 36-47, lips 48-67, each from the image's left.
std::array<std::int32_t, 68> landmark_vertices(const HeadMesh& mesh,
                                               const HeadParameters& parameters) {
    std::vector<Target> targets;
    add_jaw(targets);
    const auto on_face = [&](double x, double y) {
        targets.push_back({face_point(x, y, parameters)});
    };
    constexpr std::array<double, 5> brow{0.465, 0.385, 0.30, 0.215, 0.13};
    constexpr std::array<double, 5> brow_height{0.215, 0.245, 0.25, 0.24, 0.22};
    for (std::size_t k = 0; k < 5; ++k) on_face(-brow[k], brow_height[k]);
    for (std::size_t k = 5; k-- > 0;) on_face(brow[k], brow_height[k]);
    for (const double y : {0.06, -0.05, -0.15, -0.25}) on_face(0.0, y);
    for (const double x : {-1.25, -0.65, 0.0, 0.65, 1.25})
        on_face(x * parameters.nose_width, -0.33);
    add_eye(targets, parameters, -1.0);
    add_eye(targets, parameters, 1.0);
    add_lips(targets, parameters);
    std::array<std::int32_t, 68> landmarks{};
    for (std::size_t k = 0; k < landmarks.size(); ++k)
        landmarks[k] = nearest_vertex(mesh, targets.at(k));
    return landmarks;
}

}  // namespace

}  // namespace stymo::morphable

namespace stymo {

namespace {

[[nodiscard]] MorphableHead generated_head() {
    const morphable::HeadParameters parameters;
    morphable::HeadMesh mesh = morphable::generate_head(parameters);
    const Shape vertices{static_cast<std::int64_t>(mesh.vertices.size()), 3};
    MorphableHead head;
    head.mean = morphable::rows_tensor({mesh.vertices}).reshaped(vertices);
    head.mean_albedo = morphable::rows_tensor({mesh.albedo}).reshaped(vertices);
    head.identity = morphable::rows_tensor(morphable::identity_basis(mesh));
    head.expression = morphable::rows_tensor(morphable::expression_basis(mesh, head.one_sided));
    head.albedo =
        morphable::rows_tensor(morphable::texture_basis(mesh.vertices, mesh.parts, mesh.albedo));
    head.expression_names = morphable::expression_names();
    std::vector<float> values;
    for (const Eigen::Vector2d& uv : mesh.grid_uv)
        values.insert(values.end(), {static_cast<float>(uv[0]), static_cast<float>(uv[1])});
    head.grid_uv = Tensor::from({vertices[0], 2}, std::span<const float>(values));
    head.landmarks = morphable::landmark_vertices(mesh, parameters);
    head.triangles = std::move(mesh.triangles);
    head.parts = std::move(mesh.parts);
    return head;
}

}  // namespace

const MorphableHead& builtin_head() {
    static const MorphableHead head = generated_head();
    return head;
}

}  // namespace stymo
