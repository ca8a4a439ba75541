#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/json_check.h"
#include "core/parallel.h"
#include "render/morphable/head_source.h"
#include "render/morphable/scanned_head.h"

namespace stymo {

namespace {

using Json = nlohmann::json;
using Triangle = std::array<std::int32_t, 3>;

struct ObjMesh {
    std::vector<float> vertices;      ///< x, y, z of each
    std::vector<Triangle> triangles;  ///< a face with more corners is split into a fan
};

/// Removes and returns the next word of a line; empty at the end.
[[nodiscard]] std::string_view next_word(std::string_view& line) {
    const auto begin = std::min(line.find_first_not_of(" \t\r"), line.size());
    const auto end = std::min(line.find_first_of(" \t\r", begin), line.size());
    const std::string_view word = line.substr(begin, end - begin);
    line.remove_prefix(end);
    return word;
}

template <class Number>
[[nodiscard]] Number number(std::string_view word, const std::filesystem::path& path,
                            std::size_t line) {
    Number value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size())
        fail<FileError>(path.string(), ": line ", line, ": \"", word, "\" is not a number");
    return value;
}

void add_face(ObjMesh& mesh, std::string_view corners, const std::filesystem::path& path,
              std::size_t line) {
    std::vector<std::int32_t> face;
    const auto count = static_cast<std::int64_t>(mesh.vertices.size() / 3);
    for (std::string_view word = next_word(corners); !word.empty(); word = next_word(corners)) {
        // vertex, vertex/texture, vertex//normal or vertex/texture/normal; negative numbers count
        // from the last vertex.
        const auto index = number<std::int64_t>(word.substr(0, word.find('/')), path, line);
        const std::int64_t vertex = index < 0 ? count + index : index - 1;
        if (vertex < 0 || vertex >= count)
            fail<FileError>(path.string(), ": line ", line, " names vertex ", index, " of ", count);
        face.push_back(static_cast<std::int32_t>(vertex));
    }
    for (std::size_t k = 2; k < face.size(); ++k)
        mesh.triangles.push_back({face[0], face[k - 1], face[k]});
}

[[nodiscard]] ObjMesh read_obj(const std::filesystem::path& path, bool with_faces) {
    const std::string text = read_file(path);
    ObjMesh mesh;
    std::size_t line_number = 0;
    for (std::string_view rest = text; !rest.empty();) {
        std::string_view line = rest.substr(0, rest.find('\n'));
        rest.remove_prefix(std::min(line.size() + 1, rest.size()));
        ++line_number;
        const std::string_view keyword = next_word(line);
        if (keyword == "v") {
            for (int axis = 0; axis < 3; ++axis) {
                const auto value = number<float>(next_word(line), path, line_number);
                if (!std::isfinite(value))
                    fail<FileError>(path.string(), ": line ", line_number, " holds ", value);
                mesh.vertices.push_back(value);
            }
        } else if (keyword == "f" && with_faces) {
            add_face(mesh, line, path, line_number);
        }
    }
    if (mesh.vertices.empty()) fail<FileError>(path.string(), ": holds no vertices");
    return mesh;
}

/// (targets, V, 3): the differences of the meshes in these files from the neutral one.
[[nodiscard]] Tensor differences(const std::vector<std::filesystem::path>& targets,
                                 const ObjMesh& neutral) {
    const auto count = static_cast<std::int64_t>(targets.size());
    Tensor basis =
        Tensor::zeros({count, static_cast<std::int64_t>(neutral.vertices.size() / 3), 3});
    const auto values = basis.mutable_values<float>();
    parallel_for(count, 1, [&](std::int64_t begin, std::int64_t end) {
        for (auto row = static_cast<std::size_t>(begin); row < static_cast<std::size_t>(end);
             ++row) {
            const ObjMesh mesh = read_obj(targets[row], false);
            if (mesh.vertices.size() != neutral.vertices.size()) {
                fail<FileError>(targets[row].string(), ": holds ", mesh.vertices.size() / 3,
                                " vertices, the neutral mesh ", neutral.vertices.size() / 3);
            }
            for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
                values[row * mesh.vertices.size() + i] = mesh.vertices[i] - neutral.vertices[i];
        }
    });
    return basis;
}

struct Indices {
    std::vector<std::string> expressions;
    std::array<std::int32_t, 68> landmarks{};
};

[[nodiscard]] Indices read_indices(const std::filesystem::path& path, std::size_t vertex_count) {
    const std::string text = read_file(path);
    if (const auto fault = json_fault(text)) fail<FileError>(path.string(), ": ", *fault);
    const Json json = Json::parse(text, nullptr, false);
    if (!json.is_object()) fail<FileError>(path.string(), ": is not a JSON object");
    const Json names = json.value("expressions", Json());
    if (!names.is_array() || names.empty() ||
        names.size() > static_cast<std::size_t>(MorphableHead::expression_size))
        fail<FileError>(path.string(), ": \"expressions\" is not an array of 1 to ",
                        MorphableHead::expression_size, " names");
    Indices indices;
    for (const Json& name : names) {
        if (!name.is_string())
            fail<FileError>(path.string(), ": \"expressions\" holds ", name.dump(),
                            ", which is no name");
        if (name.get<std::string>().find('/') != std::string::npos)
            fail<FileError>(path.string(), ": \"expressions\" holds ", name.dump(),
                            ", which is no name of a file in this folder");
        indices.expressions.push_back(name.get<std::string>());
    }
    const Json landmarks = json.value("idx_to_landmark_verts", Json());
    if (!landmarks.is_array() || landmarks.size() != indices.landmarks.size())
        fail<FileError>(path.string(),
                        ": \"idx_to_landmark_verts\" is not an array of 68 vertices");
    for (std::size_t k = 0; k < indices.landmarks.size(); ++k) {
        const Json& vertex = landmarks[k];
        if (!vertex.is_number_unsigned() || vertex.get<std::uint64_t>() >= vertex_count)
            fail<FileError>(path.string(), ": \"idx_to_landmark_verts\" names vertex ",
                            vertex.dump(), " of ", vertex_count);
        indices.landmarks[k] = vertex.get<std::int32_t>();
    }
    return indices;
}

[[nodiscard]] std::vector<std::filesystem::path> identity_files(
    const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> files;
    while (std::cmp_less(files.size(), MorphableHead::identity_size)) {
        const std::string digits = std::to_string(files.size());
        const std::filesystem::path file =
            folder / ("identity" + std::string(3 - digits.size(), '0') + digits + ".obj");
        if (!std::filesystem::exists(file)) break;
        files.push_back(file);
    }
    if (files.empty())
        fail<FileError>(folder.string(),
                        ": holds no identity000.obj; is it the FaceXModel of ICT-FaceKit?");
    return files;
}

}  // namespace

MorphableHead read_obj_head(const std::filesystem::path& folder) {
    const ObjMesh neutral = read_obj(folder / "generic_neutral_mesh.obj", true);
    const Indices indices =
        read_indices(folder / "vertex_indices.json", neutral.vertices.size() / 3);
    std::vector<std::filesystem::path> expression_files;
    for (const std::string& name : indices.expressions)
        expression_files.push_back(folder / (name + ".obj"));
    return morphable::head_from_scans(
        {folder.string(),
         Tensor::from({static_cast<std::int64_t>(neutral.vertices.size() / 3), 3},
                      std::span<const float>(neutral.vertices)),
         differences(identity_files(folder), neutral), differences(expression_files, neutral),
         neutral.triangles, indices.landmarks, indices.expressions});
}

}  // namespace stymo
