#include "core/io/ply_file.h"

#include <bit>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/image_bytes.h"

namespace stymo {

namespace {

std::string header(const PlyMesh& mesh) {
    std::string text = "ply\nformat binary_little_endian 1.0\ncomment stymo\nelement vertex " +
                       std::to_string(mesh.vertices.shape(0)) +
                       "\nproperty float x\nproperty float y\nproperty float z\n";
    if (mesh.normals.defined()) text += "property float nx\nproperty float ny\nproperty float nz\n";
    if (mesh.colors.defined())
        text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    return text + "element face " + std::to_string(mesh.triangles.size()) +
           "\nproperty list uchar int vertex_indices\nend_header\n";
}

void append_word(std::string& bytes, std::uint32_t word) {
    for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(word >> shift & 0xFFU);
}

}  // namespace

void write_ply(const std::filesystem::path& path, const PlyMesh& mesh) {
    const Shape& shape = mesh.vertices.shape();
    const auto fits = [&](const Tensor& values) {
        return !values.defined() || values.shape() == shape;
    };
    if (shape.rank() != 2 || shape[1] != 3 || !fits(mesh.normals) || !fits(mesh.colors))
        fail<ShapeError>("[write_ply] vertices, normals and colors are (V, 3) each; vertices are ",
                         shape);
    std::string bytes = header(mesh);
    const std::vector<std::uint8_t> colors =
        mesh.colors.defined() ? image_bytes(mesh.colors) : std::vector<std::uint8_t>{};
    for (std::size_t vertex = 0; vertex < static_cast<std::size_t>(shape[0]); ++vertex) {
        for (const Tensor* values : {&mesh.vertices, &mesh.normals}) {
            if (!values->defined()) continue;
            for (const float value : values->values<float>().subspan(3 * vertex, 3))
                append_word(bytes, std::bit_cast<std::uint32_t>(value));
        }
        if (!colors.empty())
            bytes.append(colors.begin() + static_cast<std::ptrdiff_t>(3 * vertex),
                         colors.begin() + static_cast<std::ptrdiff_t>(3 * vertex + 3));
    }
    for (const std::array<std::int32_t, 3>& triangle : mesh.triangles) {
        bytes += '\3';
        for (const std::int32_t vertex : triangle)
            append_word(bytes, static_cast<std::uint32_t>(vertex));
    }
    write_file(path, bytes, Durability::none);
}

}  // namespace stymo
