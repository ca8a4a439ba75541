#pragma once

#include <vector>

#include "core/autograd/node.h"

namespace stymo {

/// The single place where an edge of the graph is made. Returns a constant if no input is tracked.
/// `rules[i]` belongs to `inputs[i]`. `name` must outlive the graph (a string literal).
[[nodiscard]] Variable record(const char* name, Tensor value, std::vector<Variable> inputs, Save save,
                              std::vector<VjpRule> rules);

/// The same for an op with one rule for all of its inputs, which are given as they are to be held. At least one must be tracked.
[[nodiscard]] Variable record(const char* name, Tensor value, std::vector<Node::Input> inputs, JointVjpRule joint_rule);

}  // namespace stymo
