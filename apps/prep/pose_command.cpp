#include "apps/prep/pose_command.h"

#include <iomanip>
#include <sstream>
#include <vector>

#include "apps/common/tool_options.h"
#include "apps/prep/camera_file.h"
#include "core/angle.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "fit/photo/preparation_overlay.h"
#include "render/camera_matrices.h"
#include "render/morphable/builtin_head.h"
#include "render/pose_json.h"
#include "train/data/synthetic_faces.h"

namespace stymo {
namespace {

template <class Matrix>
JsonValue matrix_json(const Matrix& matrix) {
    std::vector<std::vector<double>> rows;
    for (const auto& row : matrix.rowwise()) rows.emplace_back(row.begin(), row.end());
    return {rows};
}

Camera camera_of(const PoseCommand& options) {
    const Intrinsics intrinsics{.focal = options.focal};
    if (options.input)
        return with_focal(read_camera(*options.input, options.id, intrinsics), options.focal);
    return camera_from_pose(
        pivot_pose(radians_from_degrees(options.yaw), radians_from_degrees(options.pitch),
                   radians_from_degrees(options.roll), options.distance, options.pivot_depth),
        intrinsics);
}

JsonValue to_json(const Camera& camera) {
    const Eg3dLabel label = eg3d_label(camera);
    const Intrinsics& intrinsics = camera.intrinsics;
    return JsonValue::object({{"pose", to_json(pose_from_camera(camera))},
                              {"camera", JsonValue::object({{"focal", intrinsics.focal},
                                                            {"cx", intrinsics.center_x},
                                                            {"cy", intrinsics.center_y}})},
                              {"world_from_camera", matrix_json(world_from_camera_matrix(camera))},
                              {"camera_from_world", matrix_json(camera_from_world_matrix(camera))},
                              {"eg3d", std::vector<double>(label.begin(), label.end())}});
}

template <class Matrix>
void print_matrix(std::ostream& text, const char* name, const Matrix& matrix) {
    text << '\n' << name;
    for (const auto& row : matrix.rowwise()) {
        text << '\n';
        for (const double value : row) text << std::setw(10) << value;
    }
}

std::string text_of(const Camera& camera) {
    const Pose pose = pose_from_camera(camera);
    std::ostringstream text;
    text << std::fixed << std::setprecision(4) << "yaw " << degrees_from_radians(pose.yaw)
         << ", pitch " << degrees_from_radians(pose.pitch) << ", roll "
         << degrees_from_radians(pose.roll) << " degrees, t " << pose.translation[0] << " "
         << pose.translation[1] << " " << pose.translation[2] << ", focal length "
         << camera.intrinsics.focal;
    print_matrix(text, "world from camera (right, down, forward | centre)",
                 world_from_camera_matrix(camera));
    print_matrix(text, "camera from world", camera_from_world_matrix(camera));
    text << "\nEG3D's label\n";
    const Eg3dLabel label = eg3d_label(camera);
    for (std::size_t i = 0; i < label.size(); ++i) text << (i == 0 ? "" : " ") << label[i];
    return text.str();
}

/// The mean built-in head under light from the front.
Tensor image_of_head(const Camera& camera) {
    constexpr std::int64_t side = 192;
    constexpr std::size_t constant_band = 0, frontal_band = 2, bands = 9;
    SyntheticFace face{std::vector<float>(MorphableHead::identity_size),
                       std::vector<float>(MorphableHead::expression_size),
                       std::vector<float>(MorphableHead::texture_size),
                       std::vector<float>(3 * bands), pose_from_camera(camera)};
    for (std::size_t channel = 0; channel < 3; ++channel) {
        face.light[3 * constant_band + channel] = 0.75F;
        face.light[3 * frontal_band + channel] = -0.25F;
    }
    return render_synthetic_face(builtin_head(), face, camera.intrinsics, side).color;
}

Tensor drawing_of(const Camera& camera, const PoseCommand& options) {
    const Tensor image = options.photo ? read_image(*options.photo) : image_of_head(camera);
    if (image.shape(0) != image.shape(1))
        fail<FileError>(options.photo->string(), ": not square; poses are those of aligned photos");
    return with_head_axes(image, camera, options.pivot_depth);
}

}  // namespace

void declare_pose_command(Command& command, PoseCommand& options) {
    command.option(
        "file", options.input,
        "pose to convert: codes.json, faces.jsonl or EG3D's dataset.json with --id, or a file of "
        "25 (EG3D), 16 (4x4 world "
        "from camera) or 12 (3x4 camera from world) numbers; without one the angles below");
    command.option("--id", options.id, "id of the pose in a file with several poses").needs("file");
    command.option("--yaw", options.yaw, "degrees").range(-180, 180).excludes("file");
    command.option("--pitch", options.pitch, "degrees").range(-180, 180).excludes("file");
    command.option("--roll", options.roll, "degrees").range(-180, 180).excludes("file");
    command
        .option("--distance", options.distance,
                "distance of the frontal camera from the head's origin")
        .range(1, 100)
        .excludes("file");
    command
        .option("--pivot-depth", options.pivot_depth,
                "z of the point of the face in the middle of the image")
        .range(-1, 0.99);
    command
        .option("--focal", options.focal,
                "focal length of the converted pose, in units of the image's side")
        .range(0.1, 100);
    command.option("--out", options.out, "JSON file to write, for stymo-fit --pose");
    command.option(
        "--draw", options.draw,
        "image to write: the head's axes over --photo or the built-in head (.png or .jpg)");
    command.option("--photo", options.photo, "aligned photo to draw on").needs("--draw");
}

AppResult convert_pose(const PoseCommand& options) {
    if (options.draw) require_extension(*options.draw, {".png", ".jpg"});
    for (const auto& written : {options.out, options.draw})
        for (const auto& read : {options.input, options.photo})
            if (written && read) require_not_read(*written, {*read});
    const Camera camera = camera_of(options);
    const JsonValue json = to_json(camera);
    const Tensor drawing = options.draw ? drawing_of(camera, options) : Tensor();
    for (const auto& file : {options.out, options.draw})
        if (file) require_folder_of(*file);
    if (options.out) write_file(*options.out, json.text() + "\n");
    if (options.draw) write_image(*options.draw, drawing);
    return {text_of(camera), json};
}

}  // namespace stymo
