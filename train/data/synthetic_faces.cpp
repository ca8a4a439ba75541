#include "train/data/synthetic_faces.h"

#include <algorithm>
#include <string>

#include "core/angle.h"
#include "core/error.h"
#include "core/io/json_writer.h"
#include "render/pose_json.h"
#include "render/rasterizer.h"
#include "render/spherical_harmonics.h"
#include "train/data/synthetic_folder.h"

namespace stymo {

namespace {

using synthetic::truncated_normal;

[[nodiscard]] std::vector<float> sample_code(Rng rng, std::int64_t size) {
    std::vector<float> code(static_cast<std::size_t>(size));
    for (float& value : code) value = static_cast<float>(truncated_normal(rng, 1.0, 2.5));
    return code;
}

[[nodiscard]] Pose sample_pose(Rng rng) {
    const double yaw = radians_from_degrees(truncated_normal(rng, 14.0, 35.0));
    const double pitch = radians_from_degrees(truncated_normal(rng, 6.0, 15.0));
    const double roll = radians_from_degrees(truncated_normal(rng, 2.0, 5.0));
    const double distance = 5.3 + truncated_normal(rng, 0.06, 0.12);
    const double right = truncated_normal(rng, 0.02, 0.04);
    const double up = truncated_normal(rng, 0.02, 0.04);
    Pose pose = orbit_pose(yaw, pitch, roll, distance);
    const Eigen::Matrix3d rotation = rotation_from_angles(yaw, pitch, roll);
    pose.translation += right * rotation.col(0) + up * rotation.col(1);
    return pose;
}

[[nodiscard]] JsonValue face_record(const std::string& id, const SyntheticFace& face,
                                    const SyntheticImage& image) {
    std::vector<std::vector<double>> landmarks;
    for (const Eigen::Vector2d& point : image.landmarks)
        landmarks.push_back({point.x(), point.y()});
    return JsonValue::object({{"id", id},
                              {"pose", to_json(face.pose)},
                              {"code", JsonValue::object({{"id", face.identity},
                                                          {"expr", face.expression},
                                                          {"tex", face.texture},
                                                          {"light", face.light}})},
                              {"landmarks", landmarks}});
}

}  // namespace

SyntheticFace sample_synthetic_face(const MorphableHead& head, Rng rng) {
    SyntheticFace face{sample_code(rng.split("identity"), MorphableHead::identity_size),
                       sample_code(rng.split("expression"), MorphableHead::expression_size),
                       sample_code(rng.split("texture"), MorphableHead::texture_size),
                       synthetic::sample_light(rng.split("light")), sample_pose(rng.split("pose"))};
    for (std::size_t k = 0; k < face.expression.size(); ++k) {
        if (head.one_sided[k]) face.expression[k] = std::max(face.expression[k], 0.0F);
    }
    return face;
}

SyntheticImage render_synthetic_face(const MorphableHead& head, const SyntheticFace& face,
                                     const Intrinsics& intrinsics, std::int64_t side) {
    const Camera camera = camera_from_pose(face.pose, intrinsics);
    const Tensor vertices = head_vertices(head, face.identity, face.expression);
    const Tensor colors =
        shaded_colors(head_albedo(head, face.texture), vertex_normals(vertices, head.triangles),
                      face.light, camera);
    const RasterImage raster = rasterize(vertices, colors, head.triangles, camera, {side, side, 3});
    SyntheticImage image{raster.color, Tensor::zeros({side, side, 1}), {}};
    const auto coverage = raster.coverage.values<float>();
    const auto color = image.color.mutable_values<float>();
    const auto mask = image.mask.mutable_values<float>();
    for (std::size_t pixel = 0; pixel < mask.size(); ++pixel) {
        if (coverage[pixel] >= 0.5F) {
            mask[pixel] = 1.0F;
        } else {
            std::fill_n(color.begin() + static_cast<std::ptrdiff_t>(3 * pixel), 3, 0.0F);
        }
    }
    const auto points = vertices.values<float>();
    for (std::size_t k = 0; k < image.landmarks.size(); ++k) {
        const Eigen::Vector3f point(&points[3 * static_cast<std::size_t>(head.landmarks[k])]);
        image.landmarks[k] =
            project(camera, point.cast<double>()).head<2>() * static_cast<double>(side);
    }
    return image;
}

void write_synthetic_faces(const MorphableHead& head, const SyntheticFaceSettings& settings,
                           const Rng& rng, const std::filesystem::path& folder,
                           const std::function<void(std::int64_t)>& progress) {
    if (settings.count < 1)
        fail<ValueError>("[synthetic faces] the count must be at least 1; got ", settings.count);
    std::vector<std::string> ids;
    for (std::int64_t index = 0; index < settings.count; ++index)
        ids.push_back(synthetic::padded_number(index));
    const auto render = [&](std::int64_t index) {
        SyntheticFace face =
            sample_synthetic_face(head, rng.split(static_cast<std::uint64_t>(index)));
        face.pose = synthetic::at_focal(face.pose, settings.intrinsics.focal);
        const SyntheticImage image =
            render_synthetic_face(head, face, settings.intrinsics, settings.side);
        return synthetic::WrittenFace{
            image.color, image.mask,
            face_record(ids[static_cast<std::size_t>(index)], face, image)};
    };
    synthetic::write_faces(ids, settings.intrinsics, folder, render, progress);
}

}  // namespace stymo
