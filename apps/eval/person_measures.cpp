#include "apps/eval/person_measures.h"

#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "core/angle.h"
#include "core/median.h"
#include "core/ops/ops.h"
#include "fit/fit_report.h"
#include "nn/image_augmentation.h"
#include "nn/known_pixels.h"
#include "nn/models/display_image.h"
#include "nn/realtime/view.h"
#include "render/depth_map.h"
#include "render/morphable/face_surface.h"

namespace stymo {

namespace {

double cosine(const std::vector<double>& a, const std::vector<double>& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

}  // namespace

std::vector<double> IdentityMeasure::embedding(const Tensor& image, const Camera& camera,
                                               const CameraConfig& model) const {
    const Variable input(image.reshaped({1, image.shape(0), image.shape(1), 3}));
    return network_.embeddings(augmented(input * 2.0 - 1.0, ffhq_frames({&camera, 1}, model)))
        .value()
        .to_vector();
}

IdentityScore IdentityMeasure::measure(const Model& model, const ComparedFace& face,
                                       const ComparedFace* other, const FitResult& fit) const {
    const ViewOptions options{.samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
                              .resolution = face.batch.targets.back().shape(1)};
    const CameraConfig& frontal = model.config().camera;
    const auto view = [&](const Camera& camera) {
        return render_view(model, fit.fitted, 0, camera, options).image;
    };
    const auto seen_by = [&](const Camera& camera) {
        return embedding(view(camera), camera, frontal);
    };
    const Camera& camera = fit.cameras.front();
    const Tensor rendered = view(camera);
    const Tensor own = display_image(face.batch.targets.back(), 0);
    const std::vector<double> photo =
        embedding(where_known(known_in(face.batch, 0), own, rendered).value(), camera, frontal);
    const std::vector<double> fitted = embedding(rendered, camera, frontal);
    const auto turned = [&](double degrees) {
        const double yaw = radians_from_degrees(degrees);
        return 0.5 * (cosine(fitted, seen_by(model_camera(model, yaw, 0.0, 0.0))) +
                      cosine(fitted, seen_by(model_camera(model, -yaw, 0.0, 0.0))));
    };
    return {.photo = cosine(photo, fitted),
            .turned_15 = turned(15.0),
            .turned_30 = turned(30.0),
            .other = other != nullptr
                         ? cosine(photo, embedding(photo_with_guesses(other->batch),
                                                   other->batch.cameras.front(), frontal))
                         : std::numeric_limits<double>::infinity()};
}

namespace {

constexpr std::size_t first_inner = 17;  ///< the jaw's points are on an outline, not on the skin
constexpr double turned_degrees = 30.0;

/// In units of the image's side.
std::optional<Landmarks> landmarks_in(const FaceDetector& detector, const Tensor& image) {
    const std::vector<DetectedFace> faces = detector.find(image);
    if (faces.empty()) return std::nullopt;
    return scaled_landmarks(faces.front().landmarks, 1.0 / static_cast<double>(image.shape(1)));
}

/// Mean distance between the landmarks found in a turned view and the points of the frontal view
/// projected into it, in units of the image's side.
double mean_distance(const Landmarks& found, const std::vector<Eigen::Vector3d>& points,
                     const Camera& camera) {
    double sum = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i)
        sum += (found[first_inner + i] - project(camera, points[i]).head<2>()).norm();
    return sum / static_cast<double>(points.size());
}

}  // namespace

double shifted_difference(std::vector<double> depth_minus_expected) {
    if (depth_minus_expected.empty()) return std::numeric_limits<double>::infinity();
    const double shift = median(depth_minus_expected);
    for (double& difference : depth_minus_expected) difference = std::abs(difference - shift);
    return median(std::move(depth_minus_expected));
}

double depth_difference(const MorphableHead& head, const Tensor& vertices, const Camera& camera,
                        const Tensor& depths) {
    const FaceSurface surface = face_surface(head, vertices, camera, depths.shape(0));
    return shifted_difference(depth_differences(depths, surface)) / eye_distance(head, vertices);
}

ShapeMeasure::ShapeMeasure(const std::filesystem::path& landmark_model, MorphableHead head)
    : detector_(landmark_model), head_(std::move(head)) {}

ShapeScore ShapeMeasure::measure(const Model& model, const ComparedFace& face,
                                 const FitResult& fit) const {
    ViewOptions options{.samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
                        .resolution = face.batch.targets.back().shape(1),
                        .depth = true};
    const Camera& camera = fit.cameras.front();
    const View view = render_view(model, fit.fitted, 0, camera, options);
    ShapeScore score;
    if (face.batch.has_codes()) {
        const auto code = [&](std::size_t group) {
            return face.batch.codes[group].values<float>();
        };
        score.depth =
            depth_difference(head_, head_vertices(head_, code(0), code(1)), camera, view.depth);
    }
    const std::optional<Landmarks> frontal = landmarks_in(detector_, view.image);
    if (!frontal) return score;
    std::vector<Eigen::Vector3d> points;
    for (std::size_t i = first_inner; i < frontal->size(); ++i)
        points.push_back(point_at(camera, view.depth, (*frontal)[i]));
    options.depth = false;
    double sum = 0.0, found = 0.0;
    for (const double degrees : {-turned_degrees, turned_degrees}) {
        const Camera turned = model_camera(model, radians_from_degrees(degrees), 0.0, 0.0);
        const std::optional<Landmarks> seen =
            landmarks_in(detector_, render_view(model, fit.fitted, 0, turned, options).image);
        if (!seen) continue;
        sum += mean_distance(*seen, points, turned);
        ++found;
    }
    score.found_30 = 0.5 * found;
    if (found > 0.0) score.landmarks_30 = sum / found / inter_ocular_distance(*frontal);
    return score;
}

}  // namespace stymo
