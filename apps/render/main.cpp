#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/output_file.h"
#include "apps/common/work_plans.h"
#include "apps/render/mesh.h"
#include "apps/render/new_faces.h"
#include "apps/render/pictures.h"

namespace {

void require_names(const stymo::RenderOptions& options) {
    if (options.codes.empty() && options.sample == 0) stymo::fail<stymo::UsageError>("--codes is required");
    if (options.out.empty() && options.mesh.empty()) stymo::fail<stymo::UsageError>("--out is required");
    if (options.sample > 0 && options.out.empty()) stymo::fail<stymo::UsageError>("--sample needs --out, a folder");
    if (!options.mesh.empty()) stymo::require_extension(options.mesh, {".ply"});
    if (options.sample > 0 || options.out.empty()) return;
    if (options.orbit > 0) {
        stymo::require_extension(options.out, {".gif", ".mp4"});
    } else if (!options.to.empty()) {
        stymo::require_extension(options.out, {".gif", ".mp4", ".png", ".jpg"});
    } else {
        stymo::require_extension(options.out, {".png", ".jpg"});
    }
}

stymo::AppResult render(stymo::RenderOptions options, const stymo::CommonOptions& common) {
    require_names(options);
    stymo::require_understood(options);
    options.renderer.mode = stymo::render_mode(options.mode);
    stymo::Explainer explainer(options.explain);
    const bool encodes = !options.data.empty();
    const stymo::Model model = stymo::Model::load(options.model, encodes ? stymo::ModelParts::all : stymo::ModelParts::decoder);
    explainer.show(stymo::render_plan(model, options.renderer));
    std::vector<std::filesystem::path> written;
    if (options.sample > 0) {
        written = stymo::write_new_faces(options, model, common.seed, explainer);
    } else {
        const stymo::CodeFile face = stymo::read_code_file(options.codes);
        for (const std::filesystem::path& file : {options.out, options.mesh}) {
            if (!file.empty()) stymo::require_folder_of(file);
        }
        if (!options.out.empty())
            written = stymo::write_pictures(options.out, options, model, stymo::shots_of_face(options, model, face), explainer);
        if (!options.mesh.empty()) {
            stymo::write_mesh(options, model, face);
            written.push_back(options.mesh);
        }
    }
    std::string text;
    std::vector<std::string> names;
    for (const std::filesystem::path& path : written) {
        names.push_back(path.string());
        text += names.back() + "\n";
    }
    stymo::AppResult result{text, stymo::JsonValue::object({{"written", names}})};
    explainer.finish(result);
    return result;
}

void declare_view(stymo::Command& line, stymo::RenderOptions& options) {
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
        .one_of(stymo::render_mode_names());
    line.option("--tolerance", options.renderer.tolerance,
                "of skip and bf16: compositing weight that samples left out in a row may have together")
        .range(0, 0.99);
    line.option("--bake-resolution", options.renderer.bake_resolution,
                "of baked: cells along one side of the cube that is sampled")
        .range(8, 512);
    line.flag("--mask", options.renderer.mask, "also write the head mask, OUT_mask.png; of an animation another one");
    line.flag("--depth", options.renderer.depth,
              "also write the depth of each ray, OUT_depth.exr; of an animation one file a frame");
}

void declare_jobs(stymo::Command& line, stymo::RenderOptions& options) {
    line.option("--orbit", options.orbit, "number of frames of a turn around the head").range(0, 10000);
    line.option("--orbit-yaw", options.orbit_yaw, "degrees to either side in the orbit").range(0, 180);
    line.option("--orbit-pitch", options.orbit_pitch, "degrees up and down in the orbit").range(0, 90);
    line.option("--fps", options.frames_per_second, "frames per second of an animation").range(1, 240);
    line.option("--to", options.to,
                "codes.json of another face: pictures on the way there, a strip or an animation there and back")
        .excludes("--orbit");
    line.option("--frames", options.frames, "pictures on the way of --to, both ends included").range(2, 10000).needs("--to");
    line.option("--grid-yaw", options.grid_yaw, "FROM:TO:COUNT in degrees: a sheet of views, these from left to right")
        .excludes("--orbit")
        .excludes("--to");
    line.option("--grid-pitch", options.grid_pitch, "FROM:TO:COUNT in degrees: a sheet of views, these from top to bottom")
        .excludes("--orbit")
        .excludes("--to");
    line.option("--sample", options.sample,
                "number of new faces, drawn from the distribution of the training codes; --out is a folder, --seed decides which")
        .range(0, 10000)
        .excludes("--orbit")
        .excludes("--to")
        .excludes("--grid-yaw")
        .excludes("--grid-pitch");
    line.option("--truncation", options.truncation, "1: as varied as the training faces; 0: their mean")
        .range(0, 10)
        .needs("--sample");
    line.option("--data", options.data, "folder of faces whose codes' distribution takes the place of the model's")
        .needs("--sample");
    line.option(
        "--take", options.take,
        "groups that --to or --sample change: id, expr, tex, light, joined with commas; the others are those of --codes, of "
        "--sample without --codes the mean");
    line.option("--mesh", options.mesh, "also write the surface of the face, a .ply file; --out may be left out")
        .excludes("--sample");
    line.option("--mesh-resolution", options.meshing.resolution, "cells along the longest side of the box around the head")
        .range(2, 1024)
        .needs("--mesh");
    line.option("--mesh-level", options.meshing.level, "density of the surface").range(1e-6, 1e6).needs("--mesh");
}

}  // namespace

int main(int argc, char** argv) {
    stymo::RenderOptions options;
    stymo::CommandLine line("stymo-render", "Renders a face from any side, faces between two, new faces, and meshes.");
    line.option("--model", options.model, "model.safetensors of a training run").required();
    line.option("--codes", options.codes, "codes.json of a fit; required but with --sample");
    line.option("--out", options.out, "picture (.png, .jpg); animation (.gif, .mp4) with --orbit or --to; folder with --sample");
    declare_view(line, options);
    declare_jobs(line, options);
    stymo::declare_explain(line, options.explain);
    return line.run(argc, argv, [&](const stymo::CommonOptions& common) { return render(options, common); });
}
