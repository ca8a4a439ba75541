#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/tensor.h"

namespace stymo {

/// How a weight file stores the elements of a tensor; always little-endian.
struct ElementType {
    std::string_view name;  ///< as safetensors calls it: "F16", "I64", ...
    std::uint64_t bytes;    ///< size of one element
    /// Reads shape.size() elements: float64 from F64, float32 from all others (integers are
    /// rounded).
    Tensor (*read)(const Shape& shape, const char* data);
};

/// The type called F64 F32 F16 BF16 I8 I16 I32 I64 U8 U16 U32 U64 or BOOL; null for any other name.
[[nodiscard]] const ElementType* find_element_type(std::string_view name);
/// Product of extents that a file claims; nothing if one is negative or the product, times 8,
/// leaves the range of int64.
[[nodiscard]] std::optional<std::int64_t> checked_element_count(
    std::span<const std::int64_t> extents);

}  // namespace stymo
