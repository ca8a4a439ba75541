#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// Named tensors and a string map: the contents of a .safetensors file.
struct TensorFile {
    std::map<std::string, Tensor> tensors;
    std::map<std::string, std::string> metadata;
};

/// Whether the name of any tensor begins with the prefix.
[[nodiscard]] bool has_prefix(const TensorFile& file, std::string_view prefix);

/// Reads .safetensors. F16, BF16 and integer tensors are widened to float32 (F64 stays float64).
/// Throws FileError, which names the file, for a header that is truncated, too long, not JSON or
/// repeats a name, and for tensors whose extents do not match their bytes, or that overlap, leave
/// holes or extend beyond the file.
[[nodiscard]] TensorFile read_tensor_file(const std::filesystem::path& path);
/// The type in which a file stores elements.
enum class StoredElements {
    as_they_are,  ///< F32 or F64
    float16,      ///< F16, rounded to nearest; tensors of rank 0, such as counts, as they are
};

/// The float32 tensor that a file with float16 elements returns for this one. Throws ValueError,
/// which names the tensor, if an element exceeds the range of float16.
[[nodiscard]] Tensor as_read_from_float16(const std::string& name, const Tensor& tensor);

/// Writes the file completely or not at all (temporary file, then rename). Throws FileError if the
/// folder cannot be written to, and ValueError, which names the tensor, if an element exceeds the
/// range of float16.
void write_tensor_file(const std::filesystem::path& path, const TensorFile& contents,
                       StoredElements stored = StoredElements::as_they_are);

}  // namespace stymo
