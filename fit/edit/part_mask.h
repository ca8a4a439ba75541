#pragma once

#include <array>

#include "core/tensor.h"
#include "render/parsing_classes.h"

namespace stymo {

/// Which parts of a head are meant, in the order of `ParsingClass`.
using ParsingClassSet = std::array<bool, parsing_class_count>;

/// 1 where `classes` (H, W, 1), as FaceParser::parse gives them, is one of the parts, else 0.
[[nodiscard]] Tensor part_mask(const Tensor& classes, const ParsingClassSet& parts);

/// The parts of `is_head_class`.
[[nodiscard]] ParsingClassSet head_of_parts();

}  // namespace stymo
