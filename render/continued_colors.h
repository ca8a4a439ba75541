#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/tensor.h"

namespace stymo {

/// Colours (V, 3) of all vertices of a mesh, from colours (V, 4) that some of them have, with their
/// weights. They minimise sum_i w_i |c_i - seen_i|^2 + 1e-3 sum_(edges ij) |c_i - c_j|^2: vertices
/// of weight 1 keep their colours, and others continue them smoothly over the surface (a harmonic
/// function), across seams of a texture too. A piece without any weight gets the mean colour.
/// Throws ShapeError for other shapes.
[[nodiscard]] Tensor continued_colors(const Tensor& seen,
                                      std::span<const std::array<std::int32_t, 3>> triangles);

}  // namespace stymo
