#include "train/data/turned_face.h"

#include <span>

#include "core/ops/elementwise.h"
#include "nn/known_pixels.h"
#include "nn/realtime/view.h"
#include "render/morphable/face_surface.h"
#include "render/turned_photo.h"

namespace stymo {

namespace {

/// About 2 mm at the usual distance: what lies behind the nose is not taken for the nose.
constexpr double depth_tolerance = 0.002;
constexpr double least_known = 0.01;

Pose turned_about_head(const Pose& pose, double yaw, double pitch) {
    const Eigen::Matrix3d turn = rotation_from_angles(yaw, pitch, 0.0);
    Camera camera = camera_from_pose(pose, {});
    camera.world_from_camera = turn * camera.world_from_camera;
    const Eigen::Vector3d middle(0.0, 0.0, head_middle);
    camera.center = turn * (camera.center - middle) + middle;
    return pose_from_camera(camera);
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
    const auto surface_seen_from = [&](const Pose& pose) {
        return face_surface(head, vertices, camera_from_pose(pose, face.intrinsics), side);
    };
    const Pose pose = turned_about_head(face.pose, yaw, pitch);
    const FaceSurface from_photo = surface_seen_from(face.pose);
    const FaceSurface from_camera = surface_seen_from(pose);
    const TurnedPhoto turned =
        turned_photo({.camera = camera_from_pose(face.pose, face.intrinsics),
                      .image = face.image,
                      .mask = where_known(face.known, face.mask, 0.0).value(),
                      .depth = from_photo.depth},
                     {.camera = camera_from_pose(pose, face.intrinsics),
                      .image = Tensor::zeros(face.image.shape()),
                      .mask = from_camera.face,
                      .depth = from_camera.depth},
                     depth_tolerance);

    Face result = face;
    result.pose = pose;
    result.image = turned.image;
    // Where the weight is below 1 the colour is mixed with that of an empty view.
    result.known = Tensor::zeros(face.mask.shape());
    for (std::int64_t i = 0; i < side * side; ++i)
        if (turned.seen.values<float>()[static_cast<std::size_t>(i)] >= 1.0F)
            result.known.mutable_values<float>()[static_cast<std::size_t>(i)] = 1.0F;
    if (known_share(result.known) < least_known) return std::nullopt;
    result.mask = result.known;
    return result;
}

}  // namespace stymo
