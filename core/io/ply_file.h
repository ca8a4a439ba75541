#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>

#include "core/tensor.h"

namespace stymo {

/// The contents of a .ply file of a mesh.
struct PlyMesh {
    Tensor vertices;  ///< (V, 3) float32
    Tensor normals;   ///< (V, 3) float32, or undefined
    Tensor colors;    ///< (V, 3) RGB in [0, 1], clipped and rounded to 8 bits, or undefined
    std::span<const std::array<std::int32_t, 3>> triangles;
};

/// Writes PLY 1.0, binary little endian (Turk 1994): x y z, nx ny nz, red green blue of the
/// vertices, vertex_indices of the triangles. The file is written completely or not at all. Throws
/// ShapeError for shapes that do not match, FileError if the file cannot be written.
void write_ply(const std::filesystem::path& path, const PlyMesh& mesh);

}  // namespace stymo
