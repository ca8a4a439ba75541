#pragma once

#include <array>

#include "core/tensor.h"
#include "render/parsing_classes.h"

namespace stymo {

/// A set of parts of a head, in the order of `ParsingClass`.
using ParsingClassSet = std::array<bool, parsing_class_count>;

/// 1 where `classes` (H, W, 1), the result of FaceParser::parse, is one of the parts, else 0.
[[nodiscard]] Tensor part_mask(const Tensor& classes, const ParsingClassSet& parts);

/// The parts of `is_head_class`.
[[nodiscard]] ParsingClassSet head_of_parts();

}  // namespace stymo
