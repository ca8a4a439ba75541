#include "fit/morphable/pixel_term.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "core/autograd/grad.h"
#include "core/io/image.h"
#include "core/ops/ops.h"
#include "fit/morphable/state.h"
#include "render/rasterizer.h"
#include "render/spherical_harmonics.h"

namespace stymo::morphable {

namespace {

/// Of the reduced photo: about one vertex of the face for each of its pixels.
constexpr int photo_side = 128;

[[nodiscard]] std::int64_t clamped(double value) {
    return static_cast<std::int64_t>(std::clamp(value, 0.0, static_cast<double>(photo_side - 1)));
}

}  // namespace

/// Variables of the visible vertices, a row each.
struct PixelTerm::Rows {
    Variable poses;   ///< (n, 6)
    Variable points;  ///< (n, 3)
    Variable albedo;  ///< (n, 3)
    Variable lights;  ///< (n, 27)
};

std::vector<std::int32_t> face_vertices(const MorphableHead& head) {
    const auto points = head.mean.values<float>();
    const auto point = [&](std::int32_t vertex) {
        return points.subspan(3 * static_cast<std::size_t>(vertex), 3);
    };
    const double left = static_cast<double>(point(head.landmarks[2])[0]);
    const double right = static_cast<double>(point(head.landmarks[14])[0]);
    const double chin = static_cast<double>(point(head.landmarks[8])[1]);
    const double brow = static_cast<double>(point(head.landmarks[19])[1]);
    const double back = static_cast<double>(point(head.landmarks[1])[2]);
    const double top = brow + 0.25 * (brow - chin);
    constexpr double spacing = 0.028;
    std::set<std::array<std::int64_t, 3>> taken;
    std::vector<std::int32_t> result;
    for (std::size_t vertex = 0; vertex < head.parts.size(); ++vertex) {
        const HeadPart part = head.parts[vertex];
        if (part == HeadPart::hair || part == HeadPart::ears || part == HeadPart::mouth) continue;
        const auto p = point(static_cast<std::int32_t>(vertex));
        const double x = (2.0 * static_cast<double>(p[0]) - left - right) / (right - left);
        const double y = (2.0 * static_cast<double>(p[1]) - chin - top) / (top - chin);
        if (static_cast<double>(p[2]) < back || x * x + y * y > 1.0) continue;
        std::array<std::int64_t, 3> cell{};
        for (std::size_t axis = 0; axis < 3; ++axis)
            cell[axis] =
                static_cast<std::int64_t>(std::floor(static_cast<double>(p[axis]) / spacing));
        if (taken.insert(cell).second) result.push_back(static_cast<std::int32_t>(vertex));
    }
    return result;
}

PixelTerm::PixelTerm(const MorphableHead& head, const VertexTable& face,
                     const MorphableFitTarget& target, const Intrinsics& intrinsics,
                     const MorphableFitOptions& options)
    : head_(&head),
      face_(&face),
      intrinsics_(intrinsics),
      color_deviation_(options.color_deviation),
      color_observations_(options.color_observations),
      photo_(resize_image(target.image, photo_side, photo_side).to(DType::float64)) {
    if (target.mask.defined()) mask_ = resize_image(target.mask, photo_side, photo_side);
}

bool PixelTerm::inside_mask(double x, double y) const {
    if (x < 0.0 || y < 0.0 || x >= 1.0 || y >= 1.0) return false;
    if (!mask_.defined()) return true;
    const std::int64_t pixel = clamped(y * photo_side) * photo_side + clamped(x * photo_side);
    return mask_.values<float>()[static_cast<std::size_t>(pixel)] >= 0.5F;
}

void PixelTerm::hold(std::span<const double> state) {
    constexpr double grazing = 0.2;
    constexpr double depth_tolerance = 0.03;
    const Camera camera = camera_from_pose(pose_of(state), intrinsics_);
    const Tensor vertices = head_vertices(*head_, code_of(state, identity_begin, 100),
                                          code_of(state, expression_begin, 79));
    const Tensor normals = vertex_normals(vertices, head_->triangles);
    const RasterImage raster =
        rasterize(vertices, vertices, head_->triangles, camera, {photo_side, photo_side, 1});
    const auto point = [](const Tensor& tensor, std::int32_t vertex) -> Eigen::Vector3d {
        const auto* p = &tensor.values<float>()[3 * static_cast<std::size_t>(vertex)];
        return Eigen::Map<const Eigen::Vector3f>(p).cast<double>();
    };
    visible_.clear();
    std::vector<double> harmonics;
    for (std::size_t row = 0; row < face_->size(); ++row) {
        const Eigen::Vector3d position = point(vertices, face_->vertices[row]);
        const Eigen::Vector3d seen = project(camera, position);
        if (!inside_mask(seen[0], seen[1])) continue;
        const std::int64_t pixel =
            clamped(seen[1] * photo_side) * photo_side + clamped(seen[0] * photo_side);
        if (seen[2] >
            static_cast<double>(raster.depth.values<float>()[static_cast<std::size_t>(pixel)]) +
                depth_tolerance)
            continue;
        const Eigen::Vector3d world_normal = point(normals, face_->vertices[row]);
        const double facing = world_normal.dot(camera.center - position) / seen.z();
        if (facing < grazing) continue;
        const Eigen::Vector3d normal = camera.world_from_camera.transpose() * world_normal;
        visible_.push_back(row);
        const std::array<double, 9> values = spherical_harmonics(normal);
        harmonics.insert(harmonics.end(), values.begin(), values.end());
    }
    weights_.assign(3 * visible_.size(), 0.0);
    if (visible_.empty()) return;
    const auto count = static_cast<std::int64_t>(visible_.size());
    harmonics_ = Tensor::from({count, 9, 1}, std::span<const double>(harmonics));
    const Tensor differences = residuals(rows_at(state)).value();
    const auto values = differences.values<double>();
    const double base = color_observations_ /
                        (static_cast<double>(values.size()) * color_deviation_ * color_deviation_);
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double relative = values[i] / (2.0 * color_deviation_);
        const double falling = 1.0 + relative * relative;
        weights_[i] = base / (falling * falling);
    }
}

PixelTerm::Rows PixelTerm::rows_at(std::span<const double> state) const {
    const std::vector<double> points = table_points(*face_, state);
    const std::vector<double> albedo = table_albedo(*face_, state);
    std::vector<double> poses_seen, points_seen, albedo_seen, lights_seen;
    const auto append = [](std::vector<double>& target, std::span<const double> values) {
        target.insert(target.end(), values.begin(), values.end());
    };
    for (const std::size_t row : visible_) {
        append(poses_seen, state.first(pose_size));
        append(points_seen, std::span(points).subspan(3 * row, 3));
        append(albedo_seen, std::span(albedo).subspan(3 * row, 3));
        append(lights_seen, state.subspan(light_begin, 27));
    }
    const auto count = static_cast<std::int64_t>(visible_.size());
    const auto leaf = [&](const std::vector<double>& values, std::int64_t columns) {
        return Variable::leaf(Tensor::from({count, columns}, std::span<const double>(values)));
    };
    return {leaf(poses_seen, 6), leaf(points_seen, 3), leaf(albedo_seen, 3), leaf(lights_seen, 27)};
}

Variable PixelTerm::photo_at(const Variable& image_points) const {
    const Variable pixels = affine(image_points, photo_side, -0.5);
    const auto positions = pixels.value().values<double>();
    const auto photo = photo_.values<double>();
    const std::size_t count = positions.size() / 2;
    std::vector<double> floors;
    std::array<std::vector<double>, 4> corners;
    for (std::size_t i = 0; i < count; ++i) {
        const double x = std::floor(positions[2 * i]);
        const double y = std::floor(positions[2 * i + 1]);
        floors.insert(floors.end(), {x, y});
        for (std::size_t corner = 0; corner < 4; ++corner) {
            const std::size_t column = corner % 2, row = corner / 2;
            const auto dx = static_cast<double>(column);
            const auto dy = static_cast<double>(row);
            const auto pixel =
                static_cast<std::size_t>(clamped(y + dy) * photo_side + clamped(x + dx));
            corners[corner].insert(corners[corner].end(), &photo[3 * pixel], &photo[3 * pixel] + 3);
        }
    }
    const auto rows = static_cast<std::int64_t>(count);
    const Variable fraction =
        pixels - Variable(Tensor::from({rows, 2}, std::span<const double>(floors)));
    const Variable right = column(fraction, 0), down = column(fraction, 1);
    const Variable left = affine(right, -1.0, 1.0), up = affine(down, -1.0, 1.0);
    const auto colors = [&](std::size_t corner) {
        return Variable(Tensor::from({rows, 3}, std::span<const double>(corners[corner])));
    };
    return up * (left * colors(0) + right * colors(1)) +
           down * (left * colors(2) + right * colors(3));
}

Variable PixelTerm::residuals(const Rows& rows) const {
    const std::int64_t count = rows.points.shape(0);
    const Variable irradiance =
        reshape(sum(reshape(rows.lights, {count, 9, 3}) * Variable(harmonics_), {1}), {count, 3});
    return rows.albedo * irradiance -
           photo_at(image_points(camera_points(rows.poses, rows.points), intrinsics_));
}

double PixelTerm::cost(std::span<const double> state) const {
    if (visible_.empty()) return 0.0;
    const Tensor differences = residuals(rows_at(state)).value();
    const auto values = differences.values<double>();
    double sum = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i)
        sum += 0.5 * weights_[i] * values[i] * values[i];
    return sum;
}

void PixelTerm::add_to(NormalEquations& equations, std::span<const double> state) const {
    if (visible_.empty()) return;
    const Rows rows = rows_at(state);
    const Variable differences = residuals(rows);
    const auto values = differences.value().values<double>();
    const std::array<Variable, 4> leaves{rows.poses, rows.points, rows.albedo, rows.lights};
    const auto count = static_cast<std::int64_t>(values.size());
    Tensor jacobian = Tensor::zeros({count, static_cast<std::int64_t>(state_size) + 1});
    const auto target = jacobian.mutable_values<float>();
    for (std::size_t channel = 0; channel < 3; ++channel) {
        const std::vector<Variable> gradients =
            grad(sum(column(differences, static_cast<std::int64_t>(channel))), leaves);
        const auto by_pose = gradients[0].value().values<double>();
        const auto by_point = gradients[1].value().values<double>();
        const auto by_albedo = gradients[2].value().values<double>();
        const auto by_light = gradients[3].value().values<double>();
        for (std::size_t i = 0; i < visible_.size(); ++i) {
            const std::size_t vertex = visible_[i];
            const auto weight = static_cast<float>(std::sqrt(weights_[3 * i + channel]));
            using Row = Eigen::Map<Eigen::RowVectorXf>;
            using Slopes = Eigen::Map<const Eigen::RowVectorXd>;
            Row row(&target[(3 * i + channel) * (state_size + 1)], state_size + 1);
            row.head<pose_size>() =
                weight * Slopes(&by_pose[pose_size * i], pose_size).cast<float>();
            const Eigen::RowVector3f by_position =
                weight * Slopes(&by_point[3 * i], 3).cast<float>();
            row.segment(identity_begin, shape_size) =
                by_position.lazyProduct(face_->shape_rows(vertex));
            row.segment(texture_begin, light_begin - texture_begin) =
                weight * static_cast<float>(by_albedo[3 * i + channel]) *
                face_->color_rows(vertex).row(static_cast<Eigen::Index>(channel));
            row.segment<27>(light_begin) = weight * Slopes(&by_light[27 * i], 27).cast<float>();
            row[state_size] = weight * static_cast<float>(values[3 * i + channel]);
        }
    }
    // With the residuals as last column, the last row of the product is the gradient and its last
    // element twice the cost.
    const Tensor product =
        matmul(Variable(jacobian), Variable(jacobian), {.transpose_a = true}).value();
    const Eigen::Map<const Eigen::MatrixXf> products(product.values<float>().data(), state_size + 1,
                                                     state_size + 1);
    equations.matrix += products.topLeftCorner(state_size, state_size).cast<double>();
    equations.gradient += products.col(state_size).head(state_size).cast<double>();
    for (std::size_t i = 0; i < values.size(); ++i)
        equations.cost += 0.5 * weights_[i] * values[i] * values[i];
}

}  // namespace stymo::morphable
