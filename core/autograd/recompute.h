#pragma once

#include <functional>
#include <span>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// A part of a computation: a pure function of its inputs and of leaves (parameters).
using Segment = std::function<Variable(std::span<const Variable>)>;

/// segment(inputs), of whose graph nothing is kept but the inputs: the backward pass computes the segment once more, takes all of
/// the gradients that are needed at once and lets go of it again. With create_graph the recomputed graph stays, and derivatives
/// of any order follow.
///
/// Values have the bits of segment(inputs). So have the gradients, except that what the segment contributes to one leaf or input
/// is added up before it meets the contributions of others: where one is used by several segments, sums differ by rounding.
///
/// `inputs` must hold every tracked Variable that the segment reads and that is not a leaf; leaves are found by themselves and
/// must be the same ones in the backward pass. Throws GradientError if the segment reached the graph around it in another way,
/// or let a Variable of its own out.
[[nodiscard]] Variable recompute(const Segment& segment, std::vector<Variable> inputs);

/// function(x), a scalar, whose gradient is taken right away: its graph is gone before whatever follows makes its own. Costs no
/// more than the gradient later would. No gradient flows to anything that the function reads beside x, and there are no
/// derivatives beyond the first: grad with create_graph throws GradientError.
[[nodiscard]] Variable differentiate_at_once(const std::function<Variable(const Variable&)>& function, const Variable& x);

}  // namespace stymo
