#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/tool_options.h"
#include "apps/common/tools.h"
#include "apps/render/images.h"
#include "nn/realtime/mesh_colors.h"
#include "nn/realtime/view.h"

namespace {

void require_names(const stymo::RenderOptions& options) {
    if (options.codes.empty() && options.sample == 0)
        stymo::fail<stymo::UsageError>("--codes is required");
    if (options.out.empty() && options.mesh.empty())
        stymo::fail<stymo::UsageError>("--out is required");
    constexpr std::array films{".gif", ".webp", ".mp4"};
    const std::string extension = options.out.extension().string();
    const bool names_film = std::ranges::find(films, extension) != films.end();
    const bool names_image = extension == ".png" || extension == ".jpg" || extension == ".exr";
    if (options.sample > 0 && (options.out.empty() || names_film || names_image))
        stymo::fail<stymo::UsageError>("--sample needs --out, the name of a folder");
    if (!options.take.empty() && options.to.empty() && options.sample == 0)
        stymo::fail<stymo::UsageError>("--take requires --to or --sample");
    if (!options.mesh.empty()) stymo::require_extension(options.mesh, {".ply"});
    if (options.cutout && options.sample == 0 && options.out.extension() != ".png")
        stymo::fail<stymo::UsageError>(
            "--cutout needs a .png file as --out",
            options.out.empty() ? "" : "; " + options.out.string() + " has no soft transparency");
    if (options.sample > 0 && !options.codes.empty() && options.take.empty())
        stymo::fail<stymo::UsageError>(
            "--sample changes all groups of --codes: name those to change with --take");
    if (options.sample > 0 || options.out.empty()) return;
    if (names_film && options.orbit == 0 && options.to.empty())
        stymo::fail<stymo::UsageError>(options.out.string(),
                                       ": the name must end in .png or .jpg or .exr; films need "
                                       "--orbit, or --to another face");
    if (options.orbit > 0) {
        stymo::require_extension(options.out, {".gif", ".webp", ".mp4"});
    } else if (!options.to.empty()) {
        stymo::require_extension(options.out, {".gif", ".webp", ".mp4", ".png", ".jpg"});
    } else {
        stymo::require_extension(options.out, {".png", ".jpg", ".exr"});
    }
    if (options.depth_alone() && options.renderer.mask)
        stymo::fail<stymo::UsageError>("--mask needs an image, --out X.png");
}

stymo::AppResult render(stymo::RenderOptions options, const stymo::CommonOptions& common) {
    require_names(options);
    stymo::require_understood(options);
    options.renderer.mode = stymo::render_mode(options.mode);
    const bool encodes = !options.data.empty();
    const stymo::Model model = stymo::load_model(
        options.model, encodes ? stymo::ModelParts::all : stymo::ModelParts::decoder);
    stymo::WrittenImages images;
    if (options.sample > 0) {
        images = stymo::write_new_faces(options, model, common.seed);
    } else {
        const stymo::CodeFile face = stymo::read_own_codes(options.codes, options.model);
        if (!options.distance && options.leaves_photo())
            options.distance = stymo::usual_distance(model.config().camera, face.pose);
        for (const std::filesystem::path& file : {options.out, options.mesh}) {
            if (!file.empty()) stymo::require_folder_of(file);
        }
        if (!options.out.empty())
            images = stymo::write_images(options.out, options, model,
                                         stymo::shots_of_face(options, model, face));
        if (!options.mesh.empty()) {
            stymo::write_head_ply(options.mesh, model, face.codes, options.meshing,
                                  options.renderer);
            images.files.push_back(options.mesh);
        }
    }
    std::string text;
    std::vector<std::string> names;
    for (const std::filesystem::path& path : images.files) {
        names.push_back(path.string());
        text += names.back() + "\n";
    }
    stymo::JsonValue json = stymo::JsonValue::object({{"written", names}});
    if (images.error) {
        json.add("mode", stymo::name_of(images.mode));
        json.add("tolerance", images.tolerance);
        json.add("worst_psnr", images.error->worst_psnr);
        json.add("worst_pixel", images.error->worst_pixel);
        json.add("checked_views", images.error->views);
    }
    return {text, json};
}

void declare_view(stymo::Command& line, stymo::RenderOptions& options) {
    line.option("--yaw", options.yaw,
                "degrees; positive yaw turns the face to the image's left. Without any angle the "
                "pose of --codes is used")
        .range(-180, 180)
        .needs("--out");
    line.option("--pitch", options.pitch, "degrees").range(-180, 180).needs("--out");
    line.option("--roll", options.roll, "degrees").range(-180, 180).needs("--out");
    line.option(
            "--distance", options.distance,
            "distance of the camera, as a multiple of that of photos. Default: 1.15, which also "
            "shows hair that photos cut, or a tenth beyond a photo from farther away, but 1 for "
            "the pose of --codes")
        .range(0.6, 2.5);
    line.option("--around", options.around,
                "what the head turns around: its middle, so that from -45 to 45 degrees no more of "
                "it leaves the image than from the front, or the face, which stays in the middle")
        .one_of({"head", "face"});
    line.option("--size", options.renderer.resolution,
                "side of the image: 64, 128, 256 or 512; 0: the model's resolution")
        .range(0, 512);
    line.option("--samples", options.renderer.samples_per_ray, "samples per ray").range(2, 4096);
    line.option("--mode", options.mode, stymo::render_mode_help())
        .one_of(stymo::render_mode_names());
    line.option("--psnr", options.psnr,
                "mode skip: decibels that the worst view has against an exact one. One view in "
                "sixteen is checked; fewer than sixteen views are exact")
        .range(20, 90);
    line.option("--tolerance", options.tolerance,
                "for experts, instead of --psnr and unchecked: largest summed compositing weight "
                "of consecutive samples that are left out")
        .range(0, 0.99)
        .excludes("--psnr");
    line.flag("--keep-floaters", options.keep_floaters,
              "also show pieces that float beside the head, which are left out by default");
    line.flag("--raw", options.raw,
              "write what the decoder draws, without the soft edge beyond which a head fades to "
              "black");
    line.flag("--mask", options.renderer.mask,
              "also write the head mask, OUT_mask.png, or an animation of masks");
    line.flag("--cutout", options.cutout,
              "write the head alone, with its opacity as the alpha of a .png image");
    line.flag("--depth", options.renderer.depth,
              "also write the depth of each pixel, OUT_depth.exr, or one file per frame of an "
              "animation; with --out X.exr the depth alone, for which no image is rendered");
}

void declare_jobs(stymo::Command& line, stymo::RenderOptions& options) {
    line.option("--orbit", options.orbit, "number of frames of an orbit around the head")
        .range(0, 10000)
        .excludes("--yaw")
        .excludes("--pitch")
        .excludes("--roll");
    line.option("--orbit-yaw", options.orbit_yaw,
                "largest yaw of the orbit to either side, in degrees")
        .range(0, 180)
        .needs("--orbit");
    line.option("--orbit-pitch", options.orbit_pitch,
                "largest pitch of the orbit up and down, in degrees")
        .range(0, 90)
        .needs("--orbit");
    line.option("--fps", options.frames_per_second, "frames per second of an animation")
        .range(1, 240)
        .needs_one_of({"--orbit", "--to"});
    line.option("--to", options.to,
                "codes.json of another face: interpolates to it, as a strip or as an animation "
                "there and back")
        .excludes("--orbit");
    line.option("--frames", options.frames, "number of images of --to, both ends included")
        .range(2, 10000)
        .needs("--to");
    line.option("--grid-yaw", options.grid_yaw,
                "FROM:TO:COUNT in degrees: a sheet of views, yaw from left to right")
        .excludes("--yaw")
        .excludes("--orbit")
        .excludes("--to");
    line.option("--grid-pitch", options.grid_pitch,
                "FROM:TO:COUNT in degrees: a sheet of views, pitch from top to bottom")
        .excludes("--pitch")
        .excludes("--orbit")
        .excludes("--to");
    line.option("--sample", options.sample,
                "number of new faces, sampled from the distribution of the training codes with "
                "--seed; --out is a folder")
        .range(0, 10000)
        .excludes("--orbit")
        .excludes("--to")
        .excludes("--grid-yaw")
        .excludes("--grid-pitch");
    line.option("--truncation", options.truncation,
                "scale of the variation of new faces: 1 is that of the training faces, 0 gives "
                "their mean")
        .range(0, 10)
        .needs("--sample");
    line.option("--data", options.data,
                "folder of faces; the distribution of their codes replaces that of the model")
        .needs("--sample");
    line.option(
        "--take", options.take,
        "groups that --to or --sample change: id, expr, tex, light, joined by commas. The other "
        "groups come from --codes, or with --sample and without --codes from the mean");
    line.option("--mesh", options.mesh,
                "also write the surface of the face as a .ply file; --out is then optional")
        .excludes("--sample");
    line.option("--mesh-resolution", options.meshing.resolution,
                "cells along the longest side of the box around the head")
        .range(2, 1024)
        .needs("--mesh");
    line.option("--mesh-level", options.meshing.level,
                "density at the surface; a higher value gives a thinner head")
        .range(1e-6, 1e6)
        .needs("--mesh");
}

}  // namespace

int stymo_render(int argc, char** argv) {
    stymo::RenderOptions options;
    stymo::CommandLine line("stymo-render",
                            "Renders views, orbits, interpolations, new faces and meshes.");
    stymo::declare_model(line, options.model);
    stymo::declare_tuned(line, options.model);
    line.option("--codes", options.codes, "codes.json of a fit; required unless --sample is given");
    line.option("--out", options.out,
                "image (.png, .jpg); animation (.gif, .webp, .mp4) with --orbit or --to; folder "
                "with --sample");
    declare_view(line, options);
    declare_jobs(line, options);
    return line.run(argc, argv,
                    [&](const stymo::CommonOptions& common) { return render(options, common); });
}
