#pragma once

#include <functional>
#include <span>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// A part of a computation: a pure function of its inputs and of leaves (parameters).
using Segment = std::function<Variable(std::span<const Variable>)>;

/// Computes segment(inputs) and keeps nothing of its graph but the inputs. The backward pass
/// computes the segment again, takes all needed gradients at once, and releases the graph. With
/// create_graph the recomputed graph stays, and derivatives of any order follow.
///
/// Values have the same bits as segment(inputs). Gradients have them too, except that the
/// contributions of the segment to one leaf or input are summed before those of others are added.
/// If several segments use one leaf, the sums differ by rounding.
///
/// `inputs` must hold every tracked Variable that the segment reads and that is not a leaf. Leaves
/// are found automatically and must be the same in the backward pass. Throws GradientError if the
/// segment reads another tracked Variable of the surrounding graph, or lets one of its own escape.
[[nodiscard]] Variable recompute(const Segment& segment, std::vector<Variable> inputs);

/// Computes the scalar function(x) and its gradient at once, and releases the graph of the function
/// before it returns. The cost is that of taking the gradient later. No gradient flows to anything
/// else that the function reads. Only first derivatives exist: grad with create_graph throws
/// GradientError.
[[nodiscard]] Variable differentiate_at_once(
    const std::function<Variable(const Variable&)>& function, const Variable& x);

}  // namespace stymo
