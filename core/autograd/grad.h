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
    /// Hold the other xs fixed: a path from y ends at the first x it meets.
    bool partial = false;
    /// dL/dy; required if y is not a scalar, 1 by default if it is.
    Variable dL_dy;
};

/// dL/dx for each x of `xs`, zeros for those that y does not depend on. Runs only the rules on a
/// path from y to an x.
///
/// Throws GradientError if y is not a scalar and `dL_dy` is not given, if an x is untracked, or if
/// a rule on the path is missing; ShapeError if a rule returns a gradient of another shape than its
/// input.
[[nodiscard]] std::vector<Variable> grad(const Variable& y, std::span<const Variable> xs,
                                         const GradOptions& options = {});
[[nodiscard]] Variable grad(const Variable& y, const Variable& x, const GradOptions& options = {});

/// Takes dL/dx of xs[i].
using GradientSink = std::function<void(std::size_t i, Variable dL_dx)>;

/// The gradients of `grad`, each handed over once as soon as it is complete, while those of earlier
/// layers are still computed. Throws as `grad`, and GradientError if an x is given twice.
void grad_in_turn(const Variable& y, std::span<const Variable> xs, const GradientSink& sink,
                  const GradOptions& options = {});

}  // namespace stymo
