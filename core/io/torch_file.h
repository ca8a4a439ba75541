#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>

#include "core/io/tensor_file.h"

namespace stymo {

/// Reads the tensors of a PyTorch checkpoint (.pth, .pt), both the zip format and the older
/// ("legacy") one, which published files such as torchvision's vgg16-397923af.pth have. Nothing in
/// the file is ever executed: the reader of its pickle knows only tensors, storages, containers,
/// numbers and strings, and rejects every other class or function. Nested dictionaries give dotted
/// names. Throws FileError for a file that is truncated, malformed, not a checkpoint, or that names
/// another class or function.
[[nodiscard]] TensorFile read_torch_file(const std::filesystem::path& path);

/// Number of leading bytes that identify the format.
inline constexpr std::size_t torch_file_beginning = 64;
/// Whether a file with these leading bytes has one of the two formats.
[[nodiscard]] bool is_torch_file(std::string_view beginning);

}  // namespace stymo
