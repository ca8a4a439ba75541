#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

struct GradOptions {
    /// Record the gradient's own computation, so that it can be differentiated again.
    bool create_graph = false;
    /// Partial derivatives: hold the other xs fixed. Each path from y ends at the first x on it.
    bool partial = false;
    /// dL/dy in the shape of y; 1 by default if y has one element, else required.
    Variable dL_dy;
};

/// dL/dx for each x of `xs`; zeros if y does not depend on it. Evaluates only the rules on paths
/// from y to an x.
///
/// Throws GradientError if y has several elements and `dL_dy` is not given, if an x is untracked,
/// or if a rule on a path is missing; ShapeError if `dL_dy` has another shape than y, or if a rule
/// returns a gradient of another shape than its input.
[[nodiscard]] std::vector<Variable> grad(const Variable& y, std::span<const Variable> xs,
                                         const GradOptions& options = {});
[[nodiscard]] Variable grad(const Variable& y, const Variable& x, const GradOptions& options = {});

/// Receives dL/dx of xs[i].
using GradientSink = std::function<void(std::size_t i, Variable dL_dx)>;

/// Calls `sink` once for each gradient of `grad`, as soon as it is complete and before the
/// gradients of earlier layers are computed. Throws what `grad` throws, and GradientError if an x
/// is given twice.
void grad_in_turn(const Variable& y, std::span<const Variable> xs, const GradientSink& sink,
                  const GradOptions& options = {});

}  // namespace stymo
