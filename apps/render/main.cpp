#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/output_file.h"
#include "apps/common/work_plans.h"
#include "core/angle.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/image.h"
#include "core/progress.h"
#include "nn/models/code_file.h"
#include "nn/models/realtime/face_renderer.h"

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
    std::string mode = "exact";
    stymo::RendererOptions renderer;
    bool explain = false;
};

const std::vector<std::string> mode_names{"exact", "skip", "bf16", "baked"};

stymo::RenderMode mode_of(const std::string& name) {
    const auto place = std::ranges::find(mode_names, name) - mode_names.begin();
    return std::array{stymo::RenderMode::exact, stymo::RenderMode::skip, stymo::RenderMode::bf16,
                      stymo::RenderMode::baked}[static_cast<std::size_t>(place)];
}

/// The pose the photo was fitted in, unless an angle is given.
stymo::Camera chosen_camera(const Options& options, const stymo::Model& model, const stymo::CodeFile& face) {
    if (!options.yaw && !options.pitch && !options.roll)
        return stymo::camera_from_pose(face.pose, model.config().camera.intrinsics);
    return stymo::model_camera(model, stymo::radians_from_degrees(options.yaw.value_or(0.0)),
                               stymo::radians_from_degrees(options.pitch.value_or(0.0)),
                               stymo::radians_from_degrees(options.roll.value_or(0.0)));
}

std::vector<stymo::Tensor> orbit_frames(const Options& options, const stymo::Model& model, stymo::FaceRenderer& renderer) {
    std::vector<stymo::Tensor> frames;
    const stymo::InterruptGuard guard;
    stymo::Progress progress({.title = "render", .total = options.orbit, .unit = "frames"});
    for (int frame = 0; frame < options.orbit; ++frame) {
        if (stymo::interrupted()) stymo::fail<stymo::Error>("interrupted; nothing was written");
        const double turn = 2.0 * std::numbers::pi * frame / options.orbit;
        const stymo::Camera camera = stymo::model_camera(model, stymo::radians_from_degrees(options.orbit_yaw) * std::sin(turn),
                                                         stymo::radians_from_degrees(options.orbit_pitch) * std::cos(turn), 0.0);
        frames.push_back(renderer.render(camera).picture);
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
    stymo::Explainer explainer(options.explain);
    const stymo::Model model = stymo::Model::load(options.model, stymo::ModelParts::decoder);
    const stymo::CodeFile face = stymo::read_code_file(options.codes);
    stymo::require_folder_of(options.out);
    options.renderer.mode = mode_of(options.mode);
    explainer.show(stymo::render_plan(model, options.renderer));
    stymo::FaceRenderer renderer(model, options.renderer);
    renderer.show(face.codes);
    std::vector<std::string> written{options.out.string()};
    if (options.orbit > 0) {
        stymo::write_animation(options.out, orbit_frames(options, model, renderer), options.frames_per_second);
    } else {
        const stymo::View view = renderer.render(chosen_camera(options, model, face));
        const auto beside = [&](const char* suffix) {
            std::filesystem::path path = options.out;
            path.replace_extension();
            path += suffix;
            written.push_back(path.string());
            return path;
        };
        stymo::write_image(options.out, view.picture);
        if (options.renderer.mask) stymo::write_image(beside("_mask.png"), view.mask);
        if (options.renderer.depth) stymo::write_exr(beside("_depth.exr"), view.depth);
    }
    std::string text;
    for (const std::string& path : written) text += path + "\n";
    stymo::AppResult result{text, stymo::JsonValue::object({{"written", written}})};
    stymo::add_counts(explainer, renderer.counts());
    explainer.finish(result);
    return result;
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
    line.option("--size", options.renderer.resolution, "side of the picture: 64, 128, 256 or 512; 0: the model's own")
        .range(0, 512);
    line.option("--samples", options.renderer.samples_per_ray, "samples per ray").range(2, 4096);
    line.option("--mode", options.mode,
                "exact; skip: without samples that count for little; bf16: also with numbers of 16 bits (half precision on "
                "processors that compute it, else bfloat16); baked: the field read from "
                "samples taken once")
        .one_of(mode_names);
    line.option("--tolerance", options.renderer.tolerance,
                "of skip and bf16: compositing weight that samples left out in a row may have together")
        .range(0, 0.99);
    line.option("--bake-resolution", options.renderer.bake_resolution,
                "of baked: cells along one side of the cube that is sampled")
        .range(8, 512);
    line.option("--orbit", options.orbit, "number of frames of a turn around the head").range(0, 10000);
    line.option("--orbit-yaw", options.orbit_yaw, "degrees to either side in the orbit").range(0, 180);
    line.option("--orbit-pitch", options.orbit_pitch, "degrees up and down in the orbit").range(0, 90);
    line.option("--fps", options.frames_per_second, "frames per second of the orbit").range(1, 240);
    line.flag("--mask", options.renderer.mask, "also write the head mask, OUT_mask.png").excludes("--orbit");
    line.flag("--depth", options.renderer.depth, "also write the depth of each ray, OUT_depth.exr").excludes("--orbit");
    stymo::declare_explain(line, options.explain);
    return line.run(argc, argv, [&](const stymo::CommonOptions&) { return render(options); });
}
