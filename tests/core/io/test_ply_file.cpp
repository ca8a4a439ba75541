#include <catch2/catch.hpp>
#include <cstring>

#include "core/error.h"
#include "core/io/file.h"
#include "core/io/ply_file.h"
#include "core/io/scratch_folder.h"

using namespace stymo;

namespace {

const std::vector<std::array<std::int32_t, 3>> triangles{{0, 1, 2}, {2, 1, 258}};

Tensor numbers(std::int64_t rows, double first) {
    std::vector<double> values;
    for (std::int64_t i = 0; i < 3 * rows; ++i)
        values.push_back(first + 0.25 * static_cast<double>(i));
    return Tensor::from({rows, 3}, std::span<const double>(values)).to(DType::float32);
}

float float_at(const std::string& bytes, std::size_t offset) {
    float value = 0.0F;
    std::memcpy(&value, bytes.data() + offset, sizeof(value));
    return value;
}

}  // namespace

TEST_CASE("a mesh's file has the header and the bytes that PLY 1.0 asks for", "[ply]") {
    const ScratchFolder folder;
    const Tensor vertices = numbers(259, -1.0), normals = numbers(259, 7.0);
    Tensor colors = Tensor::zeros({259, 3});
    colors.mutable_values<float>()[3] = 1.0F;
    colors.mutable_values<float>()[4] = 0.5F;
    write_ply(folder / "mesh.ply", {vertices, normals, colors, triangles});
    const std::string bytes = read_file(folder / "mesh.ply");
    const std::string header =
        "ply\nformat binary_little_endian 1.0\ncomment stymo\nelement vertex 259\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property float nx\nproperty float ny\nproperty float nz\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    REQUIRE(bytes.starts_with(header));
    constexpr std::size_t vertex_bytes = 27;
    REQUIRE(bytes.size() == header.size() + 259 * vertex_bytes + 2 * 13);
    const std::size_t second = header.size() + vertex_bytes;
    CHECK(float_at(bytes, second) == -0.25F);
    CHECK(float_at(bytes, second + 8) == 0.25F);
    CHECK(float_at(bytes, second + 12) == 7.75F);
    CHECK(bytes.substr(second + 24, 3) == std::string("\xFF\x80\x00", 3));
    CHECK(bytes.substr(bytes.size() - 13) ==
          std::string("\x03\x02\x00\x00\x00\x01\x00\x00\x00\x02\x01\x00\x00", 13));

    write_ply(folder / "bare.ply", {vertices, {}, {}, triangles});
    CHECK(std::filesystem::file_size(folder / "bare.ply") <
          std::filesystem::file_size(folder / "mesh.ply") - 259 * 15);
}

TEST_CASE("normals or colours of another number than the vertices are refused", "[ply]") {
    const ScratchFolder folder;
    CHECK_THROWS_AS(write_ply(folder / "mesh.ply", {numbers(3, 0.0), numbers(2, 0.0), {}, {}}),
                    ShapeError);
    CHECK_THROWS_AS(write_ply(folder / "mesh.ply", {numbers(3, 0.0), {}, numbers(4, 0.0), {}}),
                    ShapeError);
    CHECK_THROWS_AS(write_ply(folder / "none/mesh.ply", {numbers(3, 0.0), {}, {}, {}}), FileError);
    CHECK_FALSE(std::filesystem::exists(folder / "mesh.ply"));
}
