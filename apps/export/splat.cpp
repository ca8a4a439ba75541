#include <memory>
#include <sstream>

#include "apps/common/tool_options.h"
#include "apps/export/check.h"
#include "apps/export/commands.h"
#include "apps/export/splat_files.h"
#include "core/progress.h"
#include "fit/face_splats.h"
#include "nn/models/code_file.h"

namespace stymo {

namespace {

struct SplatOptions {
    ModelOptions model;
    std::filesystem::path codes, out, check;
    std::int64_t count = 100'000;
};

AppResult export_splats(const SplatOptions& options) {
    require_extension(options.out, {".ply", ".spz"});
    if (!options.check.empty()) require_extension(options.check, {".png", ".jpg"});
    const Codes codes = read_own_codes(options.codes, options.model).codes;
    const Model model = load_model(options.model, ModelParts::decoder);
    for (const std::filesystem::path& file : {options.out, options.check})
        if (!file.empty()) require_folder_of(file);
    Splats splats;
    try {
        Progress progress({.title = "splats", .total = 100});
        splats = face_splats(model, codes, options.count, [&](double done) {
            progress.update(static_cast<std::int64_t>(100.0 * done));
        });
    } catch (const Error& error) {
        fail<ValueError>(options.codes.string(), ": ", error.what());
    }
    (options.out.extension() == ".ply" ? write_splat_ply : write_spz)(options.out, splats);
    std::ostringstream text;
    text << options.out.string() << '\n';
    JsonValue json =
        JsonValue::object({{"written", options.out.string()}, {"splats", splats.centers.shape(0)}});
    if (!options.check.empty())
        check_against_frames(
            options.check, model, codes,
            [&](const Camera& camera, std::int64_t side) {
                return rendered_splats(splats, camera, side);
            },
            text, json);
    return {text.str(), json};
}

}  // namespace

void declare_splat(CommandLine& line) {
    const auto options = std::make_shared<SplatOptions>();
    Command command =
        line.command("splat", "Writes a fitted face as 3D Gaussians, which viewers of splats open.",
                     [options](const CommonOptions&) { return export_splats(*options); });
    declare_model(command, options->model);
    declare_tuned(command, options->model);
    command.option("--codes", options->codes, "codes.json of a fit").required();
    command.option("--out", options->out, ".ply, or .spz, which is smaller").required();
    command.option("--count", options->count, "about this many splats").range(1000, 1'000'000);
    command.option(
        "--check", options->check,
        "also measure the splats against the model's frames, and write both as a picture");
}

}  // namespace stymo
