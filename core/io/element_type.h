#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// The type of a tensor's elements in a weight file; always little-endian.
struct ElementType {
    std::string_view name;  ///< name in safetensors: "F16", "I64", ...
    std::uint64_t bytes;    ///< size of one element
    /// Reads shape.size() elements: float64 from F64, float32 from all others (integers are
    /// rounded).
    Tensor (*read)(const Shape& shape, const char* data);
};

/// The type with the name F64, F32, F16, BF16, I8, I16, I32, I64, U8, U16, U32, U64 or BOOL; null
/// for any other name.
[[nodiscard]] const ElementType* find_element_type(std::string_view name);
/// Product of the extents in a file's header; nothing if one is negative, or if eight times the
/// product exceeds the range of int64.
[[nodiscard]] std::optional<std::int64_t> checked_element_count(
    std::span<const std::int64_t> extents);

}  // namespace stymo
