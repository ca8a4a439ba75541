#pragma once

#include <functional>
#include <span>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// A part of a computation: a pure function of its inputs and of leaves (parameters).
using Segment = std::function<Variable(std::span<const Variable>)>;

/// Gradient checkpointing (Chen et al. 2016): computes segment(inputs) and keeps only the inputs of
/// its graph. The backward pass computes the segment again, takes all needed gradients at once, and
/// releases the graph. With create_graph the recomputed graph is kept and has derivatives of any
/// order.
///
/// Values have the same bits as segment(inputs). So do gradients, except that the segment's
/// contributions to a leaf or input are summed before other contributions are added. If several
/// segments use one leaf, the sums may therefore differ by rounding.
///
/// `inputs` must hold every tracked Variable that the segment reads and that is not a leaf. Leaves
/// are found automatically and must be the same in the backward pass. Throws GradientError if the
/// segment reads another tracked Variable of the surrounding graph, or lets one of its own escape.
[[nodiscard]] Variable recompute(const Segment& segment, std::vector<Variable> inputs);

/// Computes the scalar function(x) and its gradient with respect to x, and releases the graph of
/// the function before it returns. This costs as much as taking the gradient later. No gradient
/// flows to other values that the function reads. Only first derivatives exist: grad with
/// create_graph throws GradientError.
[[nodiscard]] Variable differentiate_at_once(
    const std::function<Variable(const Variable&)>& function, const Variable& x);

}  // namespace stymo
