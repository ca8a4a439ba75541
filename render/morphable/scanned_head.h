#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/io/tensor_file.h"
#include "core/tensor.h"
#include "render/morphable/head.h"

/// Code that the readers of scanned heads share. Not part of the public interface.
namespace stymo::morphable {

/// A linear model in the units of its files: centimetres, x to the image's right, y up, z out of
/// the face.
struct ScannedHead {
    std::string name;   ///< name of the file or folder, for messages
    Tensor mean;        ///< (V, 3) float32
    Tensor identity;    ///< (up to 100, V, 3), in units of one standard deviation
    Tensor expression;  ///< (1 to 79, V, 3), one-sided shapes at full strength
    std::vector<std::array<std::int32_t, 3>> triangles;
    std::array<std::int32_t, 68> landmarks{};
    std::vector<std::string> expression_names;  ///< empty: not known
};

/// Moves a scan into the frame of the built-in head: scale * point + offset.
struct HeadFrame {
    double scale;
    Eigen::Vector3d offset;
};

/// The frame in which the corners of eyes and mouth of the points (V, 3) have the height and depth
/// that they have on the built-in head. Throws FileError, which begins with `name`, if the eyes do
/// not lie above the mouth.
[[nodiscard]] HeadFrame head_frame(const Tensor& points,
                                   const std::array<std::int32_t, 68>& landmarks,
                                   const std::string& name);

/// Moves and scales the head so that its eyes and mouth are at the positions of the built-in head,
/// fills the bases up with zero rows, removes the triangles of the neck, and adds parts and the
/// smooth colour basis of the built-in head. Throws FileError if the landmarks of eyes and mouth
/// are not arranged as in a face.
[[nodiscard]] MorphableHead head_from_scans(const ScannedHead& scanned);

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
