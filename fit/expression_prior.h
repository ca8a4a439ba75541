#pragma once

#include "core/tensor.h"
#include "nn/models/model.h"
#include "render/morphable/head.h"

namespace stymo {

/// How the expression varies among faces with one identity code: C (79, 79) with C^T C the
/// covariance, so that u C is a change of expression for standard normal u. Undefined if the model
/// has no statistics of its codes, or those of fewer than 612 faces.
[[nodiscard]] Tensor expression_directions(const Model& model);

/// Draws changes of an expression code to what the model's faces do: P (79, 79). For a change d,
/// the change d P = u C minimises |u|^2 plus the mean square of the distances, in half millimetres,
/// between the vertices of `head` moved by d and by d P. Undefined without statistics.
[[nodiscard]] Tensor plausible_changes(const Model& model, const MorphableHead& head);

}  // namespace stymo
