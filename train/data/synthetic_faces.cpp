#include "train/data/synthetic_faces.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "core/angle.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/folder_in_progress.h"
#include "core/io/image.h"
#include "core/io/json_writer.h"
#include "core/parallel.h"
#include "render/morphable/shading.h"
#include "render/pose_json.h"
#include "render/rasterizer.h"
#include "train/data/folder_records.h"

namespace stymo {

namespace {

/// Normal with mean 0, drawn again until it lies within `limit`.
[[nodiscard]] double truncated_normal(Rng& rng, double deviation, double limit) {
    double value = deviation * rng.normal();
    while (std::abs(value) > limit) value = deviation * rng.normal();
    return value;
}

[[nodiscard]] std::vector<float> sample_code(Rng rng, std::int64_t size) {
    std::vector<float> code(static_cast<std::size_t>(size));
    for (float& value : code) value = static_cast<float>(truncated_normal(rng, 1.0, 2.5));
    return code;
}

[[nodiscard]] std::vector<float> sample_light(Rng rng) {
    std::vector<float> light(27);
    std::array<double, 9> grey{};
    grey[0] = 0.84 + truncated_normal(rng, 0.07, 0.16);
    grey[1] = 0.09 + truncated_normal(rng, 0.05, 0.12);   // from above: y points down
    grey[2] = -0.13 + truncated_normal(rng, 0.05, 0.12);  // from the front: z points away
    grey[3] = truncated_normal(rng, 0.10, 0.22);
    for (std::size_t k = 4; k < grey.size(); ++k) grey[k] = truncated_normal(rng, 0.02, 0.05);
    std::array<double, 3> tint{};
    for (double& value : tint) value = 1.0 + truncated_normal(rng, 0.02, 0.05);
    for (std::size_t k = 0; k < grey.size(); ++k) {
        for (std::size_t channel = 0; channel < 3; ++channel) {
            const double colored = k == 0 ? 0.0 : truncated_normal(rng, 0.006, 0.015);
            light[3 * k + channel] = static_cast<float>(grey[k] * tint[channel] + colored);
        }
    }
    return light;
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

[[nodiscard]] std::string face_id(std::int64_t index) {
    const std::string digits = std::to_string(index);
    return std::string(digits.size() < 5 ? 5 - digits.size() : 0, '0') + digits;
}

[[nodiscard]] std::string face_record(const std::string& id, const SyntheticFace& face,
                                      const SyntheticImage& image) {
    std::vector<std::vector<double>> landmarks;
    for (const Eigen::Vector2d& point : image.landmarks)
        landmarks.push_back({point.x(), point.y()});
    const JsonValue record =
        JsonValue::object({{"id", id},
                           {"pose", to_json(face.pose)},
                           {"code", JsonValue::object({{"id", face.identity},
                                                       {"expr", face.expression},
                                                       {"tex", face.texture},
                                                       {"light", face.light}})},
                           {"landmarks", landmarks}});
    return record.text() + "\n";
}

/// Images of an earlier run would silently become part of the set.
void require_no_other_images(const std::filesystem::path& folder, std::int64_t count) {
    std::set<std::string> ours;
    for (std::int64_t index = 0; index < count; ++index) ours.insert(face_id(index) + ".png");
    for (const char* name : {"images", "masks"}) {
        if (!std::filesystem::is_directory(folder / name)) continue;
        for (const auto& entry : std::filesystem::directory_iterator(folder / name)) {
            if (!ours.contains(entry.path().filename().string())) {
                fail<FileError>(entry.path().string(), ": does not belong to the ", count,
                                " faces to be written; choose another folder or remove it");
            }
        }
    }
}

}  // namespace

SyntheticFace sample_synthetic_face(const MorphableHead& head, Rng rng) {
    SyntheticFace face{sample_code(rng.split("identity"), MorphableHead::identity_size),
                       sample_code(rng.split("expression"), MorphableHead::expression_size),
                       sample_code(rng.split("texture"), MorphableHead::texture_size),
                       sample_light(rng.split("light")), sample_pose(rng.split("pose"))};
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
    require_no_other_images(folder, settings.count);
    FolderInProgress output(folder);
    require_writable_folder(output.path() / "images");
    require_writable_folder(output.path() / "masks");
    write_intrinsics(output.path() / "camera.json", settings.intrinsics);

    std::vector<std::string> records(static_cast<std::size_t>(settings.count));
    constexpr std::int64_t faces_between_reports = 16;
    for (std::int64_t first = 0; first < settings.count; first += faces_between_reports) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        const std::int64_t count = std::min(faces_between_reports, settings.count - first);
        parallel_for(count, 1, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t index = first + begin; index < first + end; ++index) {
                const std::string id = face_id(index);
                const SyntheticFace face =
                    sample_synthetic_face(head, rng.split(static_cast<std::uint64_t>(index)));
                const SyntheticImage image =
                    render_synthetic_face(head, face, settings.intrinsics, settings.side);
                write_image(output.path() / "images" / (id + ".png"), image.color);
                write_image(output.path() / "masks" / (id + ".png"), image.mask);
                records[static_cast<std::size_t>(index)] = face_record(id, face, image);
            }
        });
        if (progress) progress(first + count);
    }
    std::string lines;
    for (const std::string& record : records) lines += record;
    write_file(output.path() / "faces.jsonl", lines);
    output.finish();
}

}  // namespace stymo
