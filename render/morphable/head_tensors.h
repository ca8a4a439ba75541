#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/io/tensor_file.h"

/// Code that the readers of head files share. Not part of the public interface.
namespace stymo::morphable {

/// The tensors of a .safetensors file of heads. All functions throw FileError, which names the file
/// and the tensor.
class HeadTensors {
public:
    /// `kind` says in messages what the file should be ("a morphable head").
    HeadTensors(const std::filesystem::path& path, std::string kind);

    [[nodiscard]] bool has(const std::string& name) const { return file_.tensors.contains(name); }
    [[nodiscard]] bool has_metadata(const std::string& key) const {
        return file_.metadata.contains(key);
    }
    [[nodiscard]] std::string metadata(const std::string& key) const;
    [[nodiscard]] std::string path() const { return path_.string(); }
    /// float32, with finite elements.
    [[nodiscard]] Tensor take(const std::string& name) const;
    [[nodiscard]] Tensor take(const std::string& name, const Shape& shape) const;
    /// A tensor of this rank whose last extents are those given and which is not empty; `form`
    /// describes it in messages ("(V, 3)").
    [[nodiscard]] Tensor take(const std::string& name, int rank,
                              std::initializer_list<std::int64_t> last, const char* form) const;
    /// The elements of a tensor as indices in [0, count).
    [[nodiscard]] std::vector<std::int32_t> indices(const std::string& name, const Tensor& tensor,
                                                    std::int64_t count) const;
    [[nodiscard]] std::vector<std::array<std::int32_t, 3>> triangles(
        const std::string& name, std::int64_t vertex_count) const;
    [[nodiscard]] std::array<std::int32_t, 68> landmarks(std::int64_t vertex_count) const;

private:
    std::filesystem::path path_;
    std::string kind_;
    TensorFile file_;
};

}  // namespace stymo::morphable
