#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/output_file.h"
#include "core/angle.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "nn/models/code_file.h"
#include "nn/models/view.h"

namespace {

struct Options {
    std::filesystem::path model;
    std::filesystem::path codes;
    std::filesystem::path out;
    std::optional<double> yaw;
    std::optional<double> pitch;
    std::optional<double> roll;
    int orbit = 0;
    double orbit_yaw = 30.0;
    double orbit_pitch = 8.0;
    double frames_per_second = 24.0;
    stymo::ViewOptions view;
};

/// The pose the photo was fitted in, unless an angle is given.
stymo::Camera chosen_camera(const Options& options, const stymo::Model& model, const stymo::CodeFile& face) {
    if (!options.yaw && !options.pitch && !options.roll)
        return stymo::camera_from_pose(face.pose, model.config().camera.intrinsics);
    return stymo::model_camera(model, stymo::radians_from_degrees(options.yaw.value_or(0.0)),
                               stymo::radians_from_degrees(options.pitch.value_or(0.0)),
                               stymo::radians_from_degrees(options.roll.value_or(0.0)));
}

std::vector<stymo::Tensor> orbit_frames(const Options& options, const stymo::Model& model, const stymo::CodeFile& face) {
    std::vector<stymo::Tensor> frames;
    const stymo::InterruptGuard guard;
    stymo::Progress progress({.title = "render", .total = options.orbit, .unit = "frames"});
    for (int frame = 0; frame < options.orbit; ++frame) {
        if (stymo::interrupted()) stymo::fail<stymo::Error>("interrupted; nothing was written");
        const double turn = 2.0 * std::numbers::pi * frame / options.orbit;
        const stymo::Camera camera = stymo::model_camera(model, stymo::radians_from_degrees(options.orbit_yaw) * std::sin(turn),
                                                         stymo::radians_from_degrees(options.orbit_pitch) * std::cos(turn), 0.0);
        frames.push_back(stymo::render_view(model, face.codes, 0, camera, options.view).picture);
        progress.update(frame + 1);
    }
    progress.finish();
    return frames;
}

stymo::AppResult render(Options options) {
    if (options.orbit > 0) {
        stymo::require_extension(options.out, {".gif", ".mp4"});
    } else {
        stymo::require_extension(options.out, {".png", ".jpg"});
    }
    const stymo::Model model = stymo::Model::load(options.model);
    const stymo::CodeFile face = stymo::read_code_file(options.codes);
    stymo::require_folder_of(options.out);
    std::vector<std::string> written{options.out.string()};
    if (options.orbit > 0) {
        stymo::write_animation(options.out, orbit_frames(options, model, face), options.frames_per_second);
    } else {
        const stymo::View view = stymo::render_view(model, face.codes, 0, chosen_camera(options, model, face), options.view);
        const auto beside = [&](const char* suffix) {
            std::filesystem::path path = options.out;
            path.replace_extension();
            path += suffix;
            written.push_back(path.string());
            return path;
        };
        stymo::write_image(options.out, view.picture);
        if (options.view.mask) stymo::write_image(beside("_mask.png"), view.mask);
        if (options.view.depth) stymo::write_exr(beside("_depth.exr"), view.depth);
    }
    std::string text;
    for (const std::string& path : written) text += path + "\n";
    return {text, stymo::JsonValue::object({{"written", written}})};
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    stymo::CommandLine line("stymo-render", "Renders a face from any side.");
    line.option("--model", options.model, "model.safetensors of a training run").required();
    line.option("--codes", options.codes, "codes.json of a fit").required();
    line.option("--out", options.out, "picture (.png, .jpg), or animation (.gif, .mp4) with --orbit").required();
    line.option("--yaw", options.yaw,
                "degrees, positive: the face turns to the image's left; without any angle the photo's own pose")
        .range(-180, 180);
    line.option("--pitch", options.pitch, "degrees").range(-180, 180);
    line.option("--roll", options.roll, "degrees").range(-180, 180);
    line.option("--size", options.view.resolution, "side of the picture: 64, 128, 256 or 512; 0: the model's own").range(0, 512);
    line.option("--samples", options.view.samples_per_ray, "samples per ray").range(2, 4096);
    line.option("--orbit", options.orbit, "number of frames of a turn around the head").range(0, 10000);
    line.option("--orbit-yaw", options.orbit_yaw, "degrees to either side in the orbit").range(0, 180);
    line.option("--orbit-pitch", options.orbit_pitch, "degrees up and down in the orbit").range(0, 90);
    line.option("--fps", options.frames_per_second, "frames per second of the orbit").range(1, 240);
    line.flag("--mask", options.view.mask, "also write the head mask, OUT_mask.png").excludes("--orbit");
    line.flag("--depth", options.view.depth, "also write the depth of each ray, OUT_depth.exr").excludes("--orbit");
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return render(options); });
}
