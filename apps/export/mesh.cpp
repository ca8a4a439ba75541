#include <tiny_gltf.h>

#include <algorithm>
#include <bit>
#include <filesystem>
#include <memory>
#include <sstream>
#include <vector>

#include "apps/common/tool_options.h"
#include "apps/export/commands.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/ply_file.h"
#include "core/tensor_eigen.h"
#include "fit/face_mesh.h"
#include "nn/models/code_file.h"
#include "render/morphable/head_source.h"

namespace stymo {

namespace {

using Rows = RowMajorMatrix<float>;

// All files are in metres, y up, the face looking along +z.

/// The buffer of a .glb file with its views and accessors.
class GltfBuffer {
public:
    explicit GltfBuffer(tinygltf::Model& model) : model_(model) { model_.buffers.emplace_back(); }

    int view(const void* data, std::size_t size, int target = 0) {
        std::vector<unsigned char>& bytes = model_.buffers[0].data;
        tinygltf::BufferView view;
        view.buffer = 0;
        view.byteOffset = bytes.size();
        view.byteLength = size;
        view.target = target;
        const auto* const begin = static_cast<const unsigned char*>(data);
        bytes.insert(bytes.end(), begin, begin + size);
        bytes.resize((bytes.size() + 3) / 4 * 4);
        model_.bufferViews.push_back(view);
        return static_cast<int>(model_.bufferViews.size()) - 1;
    }
    int view(const Rows& rows, int target = 0) {
        return view(rows.data(), static_cast<std::size_t>(rows.size()) * sizeof(float), target);
    }
    int accessor(int view, int component, std::size_t count, int type) {
        tinygltf::Accessor accessor;
        accessor.bufferView = view;
        accessor.componentType = component;
        accessor.count = count;
        accessor.type = type;
        model_.accessors.push_back(accessor);
        return static_cast<int>(model_.accessors.size()) - 1;
    }
    /// One attribute of the vertices. Positions need their bounds.
    int attribute(const Rows& rows, bool bounds = false) {
        const int number = accessor(view(rows, TINYGLTF_TARGET_ARRAY_BUFFER),
                                    TINYGLTF_COMPONENT_TYPE_FLOAT, std::size_t(rows.rows()),
                                    rows.cols() == 2 ? TINYGLTF_TYPE_VEC2 : TINYGLTF_TYPE_VEC3);
        if (bounds) set_bounds(number, rows);
        return number;
    }
    /// Displacements, of which only those that are not zero are written.
    int displacements(const Rows& rows) {
        std::vector<std::uint32_t> moved;
        for (Eigen::Index i = 0; i < rows.rows(); ++i)
            if (!rows.row(i).isZero(1e-7F)) moved.push_back(static_cast<std::uint32_t>(i));
        if (moved.empty()) moved.push_back(0);
        Rows values(std::ssize(moved), 3);
        for (std::size_t i = 0; i < moved.size(); ++i)
            values.row(static_cast<Eigen::Index>(i)) = rows.row(moved[i]);
        const int number = accessor(-1, TINYGLTF_COMPONENT_TYPE_FLOAT, std::size_t(rows.rows()),
                                    TINYGLTF_TYPE_VEC3);
        auto& sparse = model_.accessors.back().sparse;
        sparse.isSparse = true;
        sparse.count = static_cast<int>(moved.size());
        sparse.indices = {.byteOffset = 0,
                          .bufferView = view(moved.data(), moved.size() * sizeof(moved[0])),
                          .componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT};
        sparse.values = {.bufferView = view(values), .byteOffset = 0};
        Rows whole = Rows::Zero(rows.rows(), 3);
        for (const std::uint32_t i : moved) whole.row(i) = rows.row(i);
        set_bounds(number, whole);
        return number;
    }

private:
    void set_bounds(int number, const Rows& rows) {
        for (Eigen::Index axis = 0; axis < rows.cols(); ++axis) {
            auto& accessor = model_.accessors[static_cast<std::size_t>(number)];
            accessor.minValues.push_back(double{rows.col(axis).minCoeff()});
            accessor.maxValues.push_back(double{rows.col(axis).maxCoeff()});
        }
    }

    tinygltf::Model& model_;
};

tinygltf::Mesh gltf_mesh(const FaceMesh& face, GltfBuffer& buffer) {
    const TexturedMesh& surface = face.surface;
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.material = 0;
    primitive.attributes["POSITION"] =
        buffer.attribute(metres * matrix_map<float>(surface.vertices), true);
    primitive.attributes["NORMAL"] = buffer.attribute(matrix_map<float>(surface.normals));
    primitive.attributes["TEXCOORD_0"] = buffer.attribute(matrix_map<float>(surface.uv));
    const std::size_t corners = 3 * surface.triangles.size();
    primitive.indices =
        buffer.accessor(buffer.view(surface.triangles.data(), corners * sizeof(std::int32_t),
                                    TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER),
                        TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, corners, TINYGLTF_TYPE_SCALAR);
    tinygltf::Mesh mesh;
    mesh.name = "face";
    tinygltf::Value::Array names;
    const std::int64_t count = surface.vertices.shape(0);
    for (std::size_t k = 0; k < arkit_names.size(); ++k) {
        if (face.shapes.source[k] == ArkitSource::missing) continue;
        const auto rows =
            matrix_map<float>(face.targets).middleRows(static_cast<Eigen::Index>(k) * count, count);
        primitive.targets.push_back({{"POSITION", buffer.displacements(metres * rows)}});
        names.emplace_back(std::string(arkit_names[k]));
        mesh.weights.push_back(0.0);
    }
    if (!names.empty())
        mesh.extras = tinygltf::Value(
            tinygltf::Value::Object{{"targetNames", tinygltf::Value(std::move(names))}});
    mesh.primitives.push_back(std::move(primitive));
    return mesh;
}

tinygltf::Material gltf_material() {
    tinygltf::Material material;
    material.name = "face";
    material.doubleSided = true;
    material.pbrMetallicRoughness.baseColorTexture.index = 0;
    material.pbrMetallicRoughness.metallicFactor = 0.0;
    material.pbrMetallicRoughness.roughnessFactor = 1.0;
    material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object{});
    return material;
}

/// glTF 2.0, binary: the mesh with its texture, unlit because the texture holds the light, and a
/// morph target for each shape that is not missing, under ARKit's names.
void write_glb(const std::filesystem::path& path, const FaceMesh& face) {
    tinygltf::Model model;
    model.asset.version = "2.0";
    model.asset.generator = "stymo";
    GltfBuffer buffer(model);
    model.meshes.push_back(gltf_mesh(face, buffer));
    model.materials.push_back(gltf_material());
    model.extensionsUsed.emplace_back("KHR_materials_unlit");
    const std::string png = png_bytes(face.surface.texture);
    tinygltf::Image image;
    image.mimeType = "image/png";
    image.bufferView = buffer.view(png.data(), png.size());
    model.images.push_back(image);
    tinygltf::Texture texture;
    texture.source = 0;
    model.textures.push_back(texture);
    tinygltf::Node node;
    node.mesh = 0;
    node.name = "face";
    model.nodes.push_back(node);
    tinygltf::Scene scene;
    scene.nodes.push_back(0);
    model.scenes.push_back(scene);
    model.defaultScene = 0;
    std::ostringstream bytes;
    if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, bytes, false, true))
        fail<FileError>(path.string(), ": tinygltf could not write the mesh");
    write_file(path, bytes.str(), Durability::none);
}

/// The texture of a Wavefront OBJ.
std::filesystem::path texture_of(std::filesystem::path path) {
    return path.replace_filename(path.stem().string() + "_texture.png");
}

/// Wavefront OBJ, beside it STEM.mtl and STEM_texture.png. Returns the three paths.
std::vector<std::filesystem::path> write_obj(const std::filesystem::path& path,
                                             const TexturedMesh& mesh) {
    std::filesystem::path material = path;
    material.replace_extension(".mtl");
    const std::filesystem::path texture = texture_of(path);
    std::ostringstream text;
    text << "mtllib " << material.filename().string() << "\n";
    const Eigen::IOFormat format(9, Eigen::DontAlignCols, " ", "\n");
    const auto lines = [&](const char* keyword, const Rows& rows) {
        for (Eigen::Index i = 0; i < rows.rows(); ++i)
            text << keyword << rows.row(i).format(format) << '\n';
    };
    Rows uv = matrix_map<float>(mesh.uv);
    uv.col(1) = 1.0F - uv.col(1).array();
    lines("v ", metres * matrix_map<float>(mesh.vertices));
    lines("vt ", uv);
    lines("vn ", matrix_map<float>(mesh.normals));
    text << "usemtl face\n";
    for (const auto& triangle : mesh.triangles) {
        text << 'f';
        for (const std::int32_t vertex : triangle)
            text << ' ' << vertex + 1 << '/' << vertex + 1 << '/' << vertex + 1;
        text << '\n';
    }
    write_image(texture, mesh.texture);
    write_file(material,
               "newmtl face\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd " +
                   texture.filename().string() + "\n",
               Durability::none);
    write_file(path, text.str(), Durability::none);
    return {path, material, texture};
}

/// The mesh with the texture's colours at its vertices.
void write_colored_ply(const std::filesystem::path& path, const TexturedMesh& mesh) {
    Tensor vertices = mesh.vertices, colors(mesh.vertices.shape());
    mutable_matrix_map<float>(vertices) *= metres;
    auto rows = mutable_matrix_map<float>(colors);
    const auto uv = matrix_map<float>(mesh.uv);
    for (Eigen::Index i = 0; i < rows.rows(); ++i)
        std::copy_n(texel(mesh.texture, uv(i, 0), uv(i, 1)).data(), 3, rows.row(i).data());
    write_ply(path, {.vertices = vertices,
                     .normals = mesh.normals,
                     .colors = colors,
                     .triangles = mesh.triangles});
}

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
    if (options.out.extension() == ".obj" &&
        options.check.lexically_normal() == texture_of(options.out).lexically_normal())
        fail<UsageError>("--check ", options.check.string(), " is the file of the texture");
    require_not_read(options.out, {options.morphable});
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
                ".glb; .obj, with X.mtl and X_texture.png beside it; or .ply, with colours "
                "instead of a texture")
        .required();
    declare_head(command, options->morphable, "whose topology the mesh has");
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
