#pragma once

#include <filesystem>

/// Files that come with stymo, in `configs/` of the source tree or of an installation. Each
/// function returns an empty path if the file is not found.
namespace stymo {

/// A file by its name below `configs/`. Without `folder`, the folders above the program or the
/// shared library that holds this function are searched for `configs` and `share/stymo/configs`,
/// then the prefix for which stymo was configured. With it, `folder` is that `configs`.
[[nodiscard]] std::filesystem::path shipped_file(const std::filesystem::path& name,
                                                 const std::filesystem::path& folder = {});
[[nodiscard]] std::filesystem::path shipped_model(const std::filesystem::path& folder = {});
/// The file of a model: `model` itself, or the model that comes with stymo under that name, such as
/// "faces-512", unless a file of that name lies in the working folder; empty: `shipped_model`.
[[nodiscard]] std::filesystem::path named_model(const std::filesystem::path& model,
                                                const std::filesystem::path& folder = {});
/// Without this landmark network, FaceDetector uses the model of libdlib-data.
[[nodiscard]] std::filesystem::path shipped_landmark_network(
    const std::filesystem::path& folder = {});
[[nodiscard]] std::filesystem::path shipped_mask_network(const std::filesystem::path& folder = {});

}  // namespace stymo
