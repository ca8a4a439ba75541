#include "train/data/turned_face.h"

#include <algorithm>
#include <span>

#include "core/ops/elementwise.h"
#include "core/parallel.h"
#include "nn/known_pixels.h"
#include "nn/realtime/view.h"
#include "render/depth_map.h"
#include "render/morphable/face_surface.h"
#include "render/rasterizer.h"
#include "render/turned_photo.h"

namespace stymo {

namespace {

/// About 2 mm at the usual distance: what lies behind the nose is not taken for the nose.
constexpr double depth_tolerance = 0.002;
constexpr double least_known = 0.01;
/// Hair and clothes stand out from a linear head by at most this much.
constexpr double face_margin = 0.06, ear_margin = 0.12, head_margin = 0.4;
constexpr float no_head = 0.05F;
/// Half the depth of the space that holds a head, and the step at which rays are followed.
constexpr double head_radius = 1.6, ray_step = 0.07;
/// Pixels along one side of the squares that are empty or not.
constexpr std::int64_t square = 4;

/// The space of which a photo shows that it is empty: in front of the head, and wherever the photo
/// has its background.
class EmptySpace {
public:
    /// `face` is the surface of the photo's face, seen by `camera`, the photo's.
    EmptySpace(const Face& photo, const MorphableHead& head, const Tensor& vertices,
               const Camera& camera, const FaceSurface& face)
        : photo_(photo), camera_(camera), side_(photo.image.shape(0)), free_depth_(face.depth) {
        const RasterImage surface =
            rasterize(vertices, Tensor::zeros(vertices.shape()), head.triangles, camera,
                      {.width = side_, .height = side_, .samples_per_side = 1});
        const std::span<float> depths = free_depth_.mutable_values<float>();
        for (std::size_t i = 0; i < depths.size(); ++i) {
            if (surface.triangle[i] < 0) continue;
            const auto triangle = static_cast<std::size_t>(surface.triangle[i]);
            const auto corner = static_cast<std::size_t>(head.triangles[triangle][0]);
            const bool on_face = depths[i] > 0.0F;
            const double margin = on_face                                ? face_margin
                                  : head.parts[corner] == HeadPart::ears ? ear_margin
                                                                         : head_margin;
            const double depth =
                surface.depth.values<float>()[i] / direction_at(camera.intrinsics, center_of(i))[2];
            depths[i] = static_cast<float>(depth - margin);
        }
    }

    [[nodiscard]] bool holds(const Eigen::Vector3d& point) const {
        const Eigen::Vector3d projected = project(camera_, point);
        if (!(projected[2] > 0.0)) return false;
        // Beside the photo its border goes on.
        const auto pixel_at = [this](double coordinate) {
            const double last = static_cast<double>(side_) - 1.0;
            return static_cast<std::int64_t>(
                std::clamp(coordinate * static_cast<double>(side_), 0.0, last));
        };
        const auto i =
            static_cast<std::size_t>(pixel_at(projected[1]) * side_ + pixel_at(projected[0]));
        if (photo_.known.defined() && photo_.known.values<float>()[i] == 0.0F) return false;
        return photo_.mask.values<float>()[i] < no_head ||
               (point - camera_.center).norm() < free_depth_.values<float>()[i];
    }

    /// Whether all that a camera can see of a head at this image point is empty.
    [[nodiscard]] bool along_ray(const Camera& camera, const Eigen::Vector2d& image_point) const {
        const Eigen::Vector3d direction =
            camera.world_from_camera * direction_at(camera.intrinsics, image_point);
        const double middle = camera.center.norm();
        for (double depth = middle - head_radius; depth < middle + head_radius; depth += ray_step)
            if (!holds(camera.center + depth * direction)) return false;
        return true;
    }

private:
    [[nodiscard]] Eigen::Vector2d center_of(std::size_t pixel) const {
        const auto i = static_cast<std::int64_t>(pixel);
        return Eigen::Vector2d(static_cast<double>(i % side_) + 0.5,
                               static_cast<double>(i / side_) + 0.5) /
               static_cast<double>(side_);
    }

    const Face& photo_;
    const Camera& camera_;
    std::int64_t side_;
    Tensor free_depth_;  ///< up to which the photo's rays are empty; 0: not known
};

/// Marks the squares of a view whose rays are empty as known.
void add_background(const EmptySpace& space, const Camera& camera, Tensor& known) {
    const std::int64_t side = known.shape(0), squares = side / square;
    const std::span<float> values = known.mutable_values<float>();
    parallel_for(squares, 4, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin * squares; i < end * squares; ++i) {
            const std::int64_t row = i / squares, column = i % squares;
            const Eigen::Vector2d middle(static_cast<double>(column) + 0.5,
                                         static_cast<double>(row) + 0.5);
            if (!space.along_ray(camera, middle / static_cast<double>(squares))) continue;
            for (std::int64_t pixel = 0; pixel < square * square; ++pixel)
                values[static_cast<std::size_t>((row * square + pixel / square) * side +
                                                column * square + pixel % square)] = 1.0F;
        }
    });
}

}  // namespace

std::optional<Face> turned_face(const Face& face, const MorphableHead& head, double yaw,
                                double pitch) {
    if (!face.has_pose || !face.has_code || face.is_mirrored) return std::nullopt;
    const std::int64_t side = face.image.shape(0);
    const std::span<const float> code = face.code;
    const Tensor vertices =
        head_vertices(head, code.first(MorphableHead::identity_size),
                      code.subspan(MorphableHead::identity_size, MorphableHead::expression_size));
    const Camera own_camera = camera_from_pose(face.pose, face.intrinsics);
    const Camera camera = turned_about_head(own_camera, yaw, pitch);
    const FaceSurface from_photo = face_surface(head, vertices, own_camera, side);
    const FaceSurface from_camera = face_surface(head, vertices, camera, side);
    const TurnedPhoto turned =
        turned_photo({.camera = own_camera,
                      .image = face.image,
                      .mask = where_known(face.known, face.mask, 0.0).value(),
                      .depth = from_photo.depth},
                     {.camera = camera,
                      .image = Tensor::zeros(face.image.shape()),
                      .mask = from_camera.face,
                      .depth = from_camera.depth},
                     depth_tolerance);

    Face result = face;
    result.pose = pose_from_camera(camera);
    result.image = turned.image;
    // Cubic interpolation overshoots.
    for (float& value : result.image.mutable_values<float>()) value = std::clamp(value, 0.0F, 1.0F);
    // Where the weight is below 1 the colour is mixed with that of an empty view.
    result.mask = Tensor::zeros(face.mask.shape());
    for (std::int64_t i = 0; i < side * side; ++i)
        if (turned.seen.values<float>()[static_cast<std::size_t>(i)] >= 1.0F)
            result.mask.mutable_values<float>()[static_cast<std::size_t>(i)] = 1.0F;
    if (known_share(result.mask) < least_known) return std::nullopt;
    result.known = result.mask;
    add_background(EmptySpace(face, head, vertices, own_camera, from_photo), camera, result.known);
    return result;
}

}  // namespace stymo
