#include <bit>
#include <filesystem>
#include <memory>
#include <sstream>

#include "apps/common/tool_options.h"
#include "apps/export/check.h"
#include "apps/export/commands.h"
#include "apps/export/mesh_files.h"
#include "nn/models/code_file.h"
#include "render/morphable/head_source.h"

namespace stymo {

namespace {

struct MeshOptions {
    ModelOptions model;
    std::filesystem::path codes, out, morphable, check;
    std::filesystem::path landmarks = shipped_landmark_network();
    std::int64_t texture_side = 1024;
    bool neutral = false;
};

std::vector<std::filesystem::path> write_mesh(const std::filesystem::path& out,
                                              const FaceMesh& face) {
    if (out.extension() == ".obj") return write_obj(out, face.surface);
    if (out.extension() == ".glb") {
        write_glb(out, face);
    } else {
        write_colored_ply(out, face.surface);
    }
    return {out};
}

AppResult export_mesh(const MeshOptions& options) {
    require_extension(options.out, {".glb", ".obj", ".ply"});
    if (!options.check.empty()) require_extension(options.check, {".png", ".jpg"});
    if (!std::has_single_bit(static_cast<std::uint64_t>(options.texture_side)))
        fail<UsageError>("--texture ", options.texture_side, ": give a power of two");
    if (options.landmarks.empty())
        fail<UsageError>("--landmarks is required: no landmark network lies beside this program");
    const Codes codes = read_own_codes(options.codes, options.model).codes;
    const Model model = load_model(options.model, ModelParts::decoder);
    const MorphableHead head = morphable_head_from(options.morphable);
    const LandmarkModel landmarks = read_landmark_model(options.landmarks);
    for (const std::filesystem::path& file : {options.out, options.check})
        if (!file.empty()) require_folder_of(file);
    FaceMesh face;
    try {
        face = face_mesh(model, codes, head, landmarks, options.texture_side, options.neutral);
    } catch (const Error& error) {
        fail<ValueError>(options.codes.string(), ": ", error.what());
    }
    std::vector<std::string> written;
    std::ostringstream text;
    for (const std::filesystem::path& file : write_mesh(options.out, face)) {
        written.push_back(file.string());
        text << file.string() << '\n';
    }
    JsonValue json = JsonValue::object({{"written", written},
                                        {"vertices", face.surface.vertices.shape(0)},
                                        {"triangles", face.surface.triangles.size()}});
    std::array<int, 3> counts{};
    for (const ArkitSource source : face.shapes.source) ++counts[static_cast<std::size_t>(source)];
    for (std::size_t k = 0; k < counts.size(); ++k)
        json.add(name_of(static_cast<ArkitSource>(k)), counts[k]);
    if (options.out.extension() == ".glb")
        text << "ARKit's shapes: " << counts[0] << " exact, " << counts[1] << " composed, "
             << counts[2] << " missing"
             << (counts[2] == 52 ? ": this head does not name its expressions" : "") << '\n';
    if (!options.check.empty())
        check_against_frames(
            options.check, model, codes,
            [&](const Camera& camera, std::int64_t side) {
                return rendered_mesh(face.surface, camera, {side, side, 3});
            },
            text, json);
    return {text.str(), json};
}

}  // namespace

void declare_mesh(CommandLine& line) {
    const auto options = std::make_shared<MeshOptions>();
    Command command = line.command(
        "mesh",
        "Writes a fitted face as a textured mesh in metres, y up; a .glb file also has "
        "ARKit's blend shapes.",
        [options](const CommonOptions&) { return export_mesh(*options); });
    declare_model(command, options->model);
    declare_tuned(command, options->model);
    command.option("--codes", options->codes, "codes.json of a fit").required();
    command
        .option("--out", options->out,
                ".glb; .obj, with a .mtl and a .png file beside it; or .ply, with colours "
                "instead of a texture")
        .required();
    command.option("--morphable", options->morphable,
                   "head model whose topology the mesh has: a .safetensors file or a folder of "
                   "ICT-FaceKit (default: the built-in head)");
    command.option("--landmarks", options->landmarks,
                   "landmark network (default: the one that comes with stymo)");
    command.option("--texture", options->texture_side, "side of the texture, a power of two")
        .range(64, 8192);
    command.flag("--neutral", options->neutral,
                 "without the expression of the photo, to which the blend shapes are otherwise "
                 "added");
    command.option("--check", options->check,
                   "also measure the mesh against the model's frames, and write both as a picture");
}

}  // namespace stymo
