#pragma once

#include <functional>
#include <span>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// A part of a computation: a pure function of its inputs and of leaves (parameters).
using Segment = std::function<Variable(std::span<const Variable>)>;

/// segment(inputs), of whose graph nothing is kept but the inputs: the backward pass computes the segment once more, takes all of
/// its gradients at once and lets go of it again. Same bits as segment(inputs), values and gradients alike; with create_graph the
/// recomputed graph stays, and derivatives of any order follow.
///
/// `inputs` must hold every tracked Variable that the segment reads and that is not a leaf; leaves are found by themselves.
/// Throws GradientError if the segment reached the graph around it in another way.
[[nodiscard]] Variable recompute(const Segment& segment, std::vector<Variable> inputs);

}  // namespace stymo
