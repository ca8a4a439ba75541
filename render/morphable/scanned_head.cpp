#include "render/morphable/scanned_head.h"

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "core/error.h"
#include "render/morphable/displacement.h"
#include "render/morphable/skin_surface.h"

namespace stymo::morphable {

namespace {

using Points = std::vector<Eigen::Vector3d>;

/// A coefficient of 1 of a blend shape is its full strength; but a standard normal code mixes
/// dozens of them.
constexpr float expression_deviation = 0.25F;
constexpr std::int64_t ict_vertex_count = 26719;

[[nodiscard]] Eigen::Vector3d landmark_mean(const Tensor& points,
                                            const std::array<std::int32_t, 68>& landmarks,
                                            std::span<const std::size_t> which) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const std::size_t k : which) {
        const auto at = 3 * static_cast<std::size_t>(landmarks[k]);
        mean += Eigen::Map<const Eigen::Vector3f>(&points.values<float>()[at]).cast<double>();
    }
    return mean / static_cast<double>(which.size());
}

/// Vertex ranges of ICT-FaceKit; another mesh is skin all over.
[[nodiscard]] HeadPart ict_part(std::int64_t vertex, std::int64_t vertex_count) {
    if (vertex_count != ict_vertex_count) return HeadPart::skin;
    if (vertex >= 11248 && vertex < 13294) return HeadPart::mouth;
    if (vertex >= 14062 && vertex < 21451) return HeadPart::mouth;
    if (vertex >= 21451 && vertex < 24591) return HeadPart::eyes;
    return HeadPart::skin;
}

/// Transparent shells over the eyes and lashes, which need blending to look right.
[[nodiscard]] bool is_shell(std::int32_t vertex, std::int64_t vertex_count) {
    return vertex_count == ict_vertex_count && vertex >= 24591;
}

[[nodiscard]] bool below_neckline(const Eigen::Vector3d& point) {
    return point[1] < -0.93 + 0.33 * (0.78 - point[2]);
}

/// How much hair covers a point of the skull, from 0 to 1.
[[nodiscard]] double hair_cover(const Eigen::Vector3d& point) {
    const double line = point[2] > 0.0 ? 0.02 + 0.60 * smooth_step(0.05, 0.55, point[2])
                                       : 0.02 - 0.55 * smooth_step(-0.25, -0.6, point[2]);
    const double ear =
        smooth_step(0.62, 0.68, std::abs(point[0])) * smooth_step(0.36, 0.26, point[1]);
    return smooth_step(line - 0.03, line + 0.05, point[1]) * smooth_step(0.80, 0.68, point[2]) *
           (1.0 - ear);
}

/// Distance in x and y.
[[nodiscard]] double distance_to_polyline(const Eigen::Vector3d& point, const Points& line) {
    double best = 1e9;
    for (std::size_t k = 0; k + 1 < line.size(); ++k) {
        const Eigen::Vector2d along = (line[k + 1] - line[k]).head<2>();
        const Eigen::Vector2d from_start = (point - line[k]).head<2>();
        const double t =
            std::clamp(from_start.dot(along) / std::max(along.squaredNorm(), 1e-12), 0.0, 1.0);
        best = std::min(best, (from_start - t * along).norm());
    }
    return best;
}

[[nodiscard]] bool inside_polygon(const Eigen::Vector3d& point, const Points& polygon) {
    bool inside = false;
    for (std::size_t k = 0; k < polygon.size(); ++k) {
        const Eigen::Vector3d& a = polygon[k];
        const Eigen::Vector3d& b = polygon[(k + 1) % polygon.size()];
        if ((a[1] > point[1]) != (b[1] > point[1]) &&
            point[0] < a[0] + (b[0] - a[0]) * (point[1] - a[1]) / (b[1] - a[1]))
            inside = !inside;
    }
    return inside;
}

struct Paint {
    std::vector<HeadPart> parts;
    Points colors;
};

[[nodiscard]] Eigen::Vector3d eye_paint(const Eigen::Vector3d& point,
                                        const Eigen::Vector3d& center) {
    const Eigen::Vector3d outward = point - center;
    const double angle = degrees_from_radians(std::atan2(outward.head<2>().norm(), outward.z()));
    if (angle < 10.5) return {0.03, 0.03, 0.03};
    if (angle < 25.0) return {0.38, 0.30, 0.22};
    return {0.92, 0.90, 0.88};
}

/// Parts and colours from the positions of the landmarks.
[[nodiscard]] Paint painted(const Points& points, const std::array<std::int32_t, 68>& landmarks) {
    const auto run = [&](std::size_t first, std::size_t last) {
        Points line;
        for (std::size_t k = first; k <= last; ++k)
            line.push_back(points[static_cast<std::size_t>(landmarks[k])]);
        return line;
    };
    const auto count = static_cast<std::int64_t>(points.size());
    const std::array<Points, 2> brows{run(17, 21), run(22, 26)};
    const Points lips = run(48, 59);
    std::array<Eigen::Vector3d, 2> eye_centers{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    std::array<double, 2> eye_counts{};
    for (std::size_t vertex = 0; vertex < points.size(); ++vertex) {
        if (ict_part(static_cast<std::int64_t>(vertex), count) != HeadPart::eyes) continue;
        const std::size_t side = points[vertex][0] < 0.0 ? 0 : 1;
        eye_counts[side] += 1.0;
        eye_centers[side] += (points[vertex] - eye_centers[side]) / eye_counts[side];
    }
    Paint paint;
    for (std::size_t vertex = 0; vertex < points.size(); ++vertex) {
        const Eigen::Vector3d& point = points[vertex];
        HeadPart part = ict_part(static_cast<std::int64_t>(vertex), count);
        Eigen::Vector3d color = skin_color;
        if (part == HeadPart::eyes) {
            color = eye_paint(point, eye_centers[point[0] < 0.0 ? 0 : 1]);
        } else if (part == HeadPart::mouth) {
            color = count == ict_vertex_count && vertex >= 17039
                        ? Eigen::Vector3d{0.88, 0.85, 0.80}
                        : Eigen::Vector3d{0.45, 0.20, 0.18};
        } else if (const double hair = hair_cover(point); hair > 0.0) {
            if (hair > 0.5) part = HeadPart::hair;
            color = mix(color, hair_color, hair);
        } else if (point[2] > 0.4) {
            const double brow = std::min(distance_to_polyline(point, brows[0]),
                                         distance_to_polyline(point, brows[1]));
            if (brow < 0.024) part = HeadPart::brows;
            color = mix(color, {0.24, 0.17, 0.12}, 0.9 * smooth_step(0.034, 0.014, brow));
            if (inside_polygon(point, lips)) {
                part = HeadPart::lips;
                color = lip_color;
            }
        }
        paint.parts.push_back(part);
        paint.colors.push_back(color);
    }
    return paint;
}

[[nodiscard]] Tensor scaled_basis(const Tensor& basis, std::int64_t rows, float factor) {
    Tensor result = Tensor::zeros({rows, basis.shape(1), 3});
    const auto source = basis.values<float>();
    const auto target = result.mutable_values<float>();
    for (std::size_t i = 0; i < source.size(); ++i) target[i] = factor * source[i];
    return result;
}

/// Gives the painted hair some volume.
void raise_hair(Points& points, const std::vector<HeadPart>& parts) {
    for (std::size_t vertex = 0; vertex < points.size(); ++vertex) {
        Eigen::Vector3d& point = points[vertex];
        if (parts[vertex] != HeadPart::hair && parts[vertex] != HeadPart::skin) continue;
        const Eigen::Vector3d outward{point[0], point[1] - 0.2, point[2]};
        point += 0.09 * hair_cover(point) / std::max(outward.norm(), 1e-6) * outward;
    }
}

}  // namespace

HeadFrame head_frame(const Tensor& points, const std::array<std::int32_t, 68>& landmarks,
                     const std::string& name) {
    constexpr std::array<std::size_t, 4> eye_corners{36, 39, 42, 45};
    constexpr std::array<std::size_t, 2> mouth_corners{48, 54};
    const Eigen::Vector3d eyes = landmark_mean(points, landmarks, eye_corners);
    const Eigen::Vector3d mouth = landmark_mean(points, landmarks, mouth_corners);
    if (!(eyes[1] > mouth[1]))
        fail<FileError>(name, ": the landmarks of the eyes do not lie above those of the mouth");
    const double scale = (eye_height - mouth_height) / (eyes[1] - mouth[1]);
    constexpr double eye_depth = 0.68;
    return {scale, Eigen::Vector3d(0.0, eye_height, eye_depth) - scale * eyes};
}

MorphableHead head_from_scans(const ScannedHead& scanned) {
    const std::int64_t count = scanned.mean.shape(0);
    MorphableHead head;
    head.landmarks = scanned.landmarks;
    Points points(static_cast<std::size_t>(count));
    const auto values = scanned.mean.values<float>();
    for (std::size_t i = 0; i < points.size(); ++i)
        points[i] = Eigen::Map<const Eigen::Vector3f>(&values[3 * i]).cast<double>();
    const HeadFrame frame = head_frame(scanned.mean, head.landmarks, scanned.name);
    for (Eigen::Vector3d& point : points) point = frame.scale * point + frame.offset;
    for (const auto& triangle : scanned.triangles) {
        const bool hidden = std::any_of(triangle.begin(), triangle.end(), [&](std::int32_t vertex) {
            return is_shell(vertex, count) ||
                   below_neckline(points[static_cast<std::size_t>(vertex)]);
        });
        if (!hidden) head.triangles.push_back(triangle);
    }
    Paint paint = painted(points, head.landmarks);
    raise_hair(points, paint.parts);
    head.mean = rows_tensor({points}).reshaped({count, 3});
    head.identity = scaled_basis(scanned.identity, MorphableHead::identity_size,
                                 static_cast<float>(frame.scale));
    head.expression = scaled_basis(scanned.expression, MorphableHead::expression_size,
                                   static_cast<float>(frame.scale) * expression_deviation);
    head.expression_names = scanned.expression_names;
    std::fill_n(head.one_sided.begin(), scanned.expression.shape(0), true);
    head.mean_albedo = rows_tensor({paint.colors}).reshaped({count, 3});
    head.albedo = rows_tensor(texture_basis(points, paint.parts, paint.colors));
    head.parts = std::move(paint.parts);
    return head;
}

HeadTensors::HeadTensors(const std::filesystem::path& path, std::string kind)
    : path_(path), kind_(std::move(kind)), file_(read_tensor_file(path)) {}

std::string HeadTensors::metadata(const std::string& key) const {
    const auto found = file_.metadata.find(key);
    if (found == file_.metadata.end())
        fail<FileError>(path(), ": its metadata have no \"", key, "\"; is it ", kind_, "?");
    return found->second;
}

Tensor HeadTensors::take(const std::string& name) const {
    const auto found = file_.tensors.find(name);
    if (found == file_.tensors.end())
        fail<FileError>(path(), ": holds no tensor \"", name, "\"; is it ", kind_, "?");
    if (!found->second.all_finite())
        fail<FileError>(path(), ": \"", name, "\" holds values that are not finite");
    return found->second.to(DType::float32);
}

Tensor HeadTensors::take(const std::string& name, const Shape& shape) const {
    Tensor tensor = take(name);
    if (!(tensor.shape() == shape))
        fail<FileError>(path(), ": \"", name, "\" is ", tensor.shape(), ", expected ", shape);
    return tensor;
}

Tensor HeadTensors::take(const std::string& name, int rank,
                         std::initializer_list<std::int64_t> last, const char* form) const {
    Tensor tensor = take(name);
    const auto extents = tensor.shape().extents();
    if (tensor.rank() != rank || tensor.size() == 0 ||
        !std::equal(last.begin(), last.end(), extents.end() - std::ssize(last)))
        fail<FileError>(path(), ": \"", name, "\" is ", tensor.shape(), ", expected ", form);
    return tensor;
}

std::vector<std::int32_t> HeadTensors::indices(const std::string& name, const Tensor& tensor,
                                               std::int64_t count) const {
    std::vector<std::int32_t> result;
    for (const float value : tensor.values<float>()) {
        if (!(value >= 0.0F) || !(value < static_cast<float>(count)))
            fail<FileError>(path(), ": \"", name, "\" names number ", value, " of ", count);
        result.push_back(static_cast<std::int32_t>(value));
    }
    return result;
}

std::vector<std::array<std::int32_t, 3>> HeadTensors::triangles(const std::string& name,
                                                                std::int64_t vertex_count) const {
    const std::vector<std::int32_t> corners =
        indices(name, take(name, 2, {3}, "(T, 3)"), vertex_count);
    std::vector<std::array<std::int32_t, 3>> result(corners.size() / 3);
    for (std::size_t i = 0; i < corners.size(); ++i) result[i / 3][i % 3] = corners[i];
    return result;
}

std::array<std::int32_t, 68> HeadTensors::landmarks(std::int64_t vertex_count) const {
    const std::vector<std::int32_t> vertices =
        indices("landmarks68", take("landmarks68", {68}), vertex_count);
    std::array<std::int32_t, 68> result{};
    std::ranges::copy(vertices, result.begin());
    return result;
}

}  // namespace stymo::morphable
