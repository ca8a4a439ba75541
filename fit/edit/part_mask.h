#pragma once

#include <array>

#include "core/tensor.h"
#include "render/head_parts.h"

namespace stymo {

/// Which parts of a head are meant, in the order of `HeadPart`.
using HeadPartSet = std::array<bool, head_part_count>;

/// 1 where `classes` (H, W, 1), as FaceParser::parse gives them, is one of the parts, else 0.
[[nodiscard]] Tensor part_mask(const Tensor& classes, const HeadPartSet& parts);

/// The parts of `is_head_class`.
[[nodiscard]] HeadPartSet head_of_parts();

}  // namespace stymo
