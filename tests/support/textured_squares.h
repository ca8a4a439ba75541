#pragma once

#include <filesystem>
#include <vector>

#include "core/io/tensor_file.h"

namespace stymo {

/// A file of two textured heads that are rectangles 2 wide and 1 high, the second 0.2 deeper: eyes
/// at the upper corners, mouth at the lower ones. The upper half is head. The first texture (4 x 4)
/// is 10 + 60 * column + 20 * row, the second 50. The expression L lowers the mouth by 0.5. The
/// hair, made for the first head, lies 0.1 before it; its left half is transparent, its right half
/// 200.
inline TensorFile textured_squares() {
    const auto tensor = [](const Shape& shape, const std::vector<float>& values) {
        return Tensor::from(shape, std::span<const float>(values));
    };
    const std::vector<float> corners{0, 0, 1, 0, 0, 1, 1, 1};
    const std::vector<float> triangles{0, 2, 1, 1, 2, 3};
    std::vector<float> landmarks(68, 0.0F);
    for (const std::size_t k : {42U, 45U}) landmarks[k] = 1.0F;
    landmarks[48] = 2.0F;
    landmarks[54] = 3.0F;
    std::vector<float> textures;
    for (std::size_t i = 0; i < 48; ++i)
        textures.push_back(10.0F + 60.0F * static_cast<float>(i / 3 % 4) +
                           20.0F * static_cast<float>(i / 12));
    textures.resize(96, 50.0F);
    TensorFile file;
    file.tensors["vertices"] = tensor(
        {2, 4, 3},
        {-1, 1, 0, 1, 1, 0, -1, 0, 0, 1, 0, 0, -1, 1, -0.2, 1, 1, -0.2, -1, 0, -0.2, 1, 0, -0.2});
    file.tensors["triangles"] = tensor({2, 3}, triangles);
    file.tensors["uv"] = tensor({4, 2}, corners);
    file.tensors["welded"] = tensor({4}, {0, 1, 2, 3});
    file.tensors["head"] = tensor({4}, {1, 1, 0, 0});
    file.tensors["landmarks68"] = tensor({68}, landmarks);
    file.tensors["expressions"] = tensor({1, 4, 3}, {0, 0, 0, 0, 0, 0, 0, -0.5, 0, 0, -0.5, 0});
    file.tensors["textures"] = tensor({2, 4, 4, 3}, textures);
    file.tensors["hair.0.owner"] = tensor({1}, {0});
    file.tensors["hair.0.vertices"] =
        tensor({4, 3}, {-1, 1, 0.1, 1, 1, 0.1, -1, 0, 0.1, 1, 0, 0.1});
    file.tensors["hair.0.triangles"] = tensor({2, 3}, triangles);
    file.tensors["hair.0.uv"] = tensor({4, 2}, corners);
    file.tensors["hair.0.texture"] = tensor({1, 2, 4}, {200, 200, 200, 0, 200, 200, 200, 255});
    file.tensors["hair.0.anchors"] = tensor({4, 1}, {0, 1, 2, 3});
    file.metadata["expressions"] = "L";
    return file;
}

}  // namespace stymo
