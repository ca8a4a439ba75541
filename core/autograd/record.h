#pragma once

#include <vector>

#include "core/autograd/node.h"

namespace stymo {

/// Records an op in the graph; no other function adds edges. Returns a constant if no input is
/// tracked. `rules[i]` belongs to `inputs[i]`; throws GradientError for different numbers. `name`
/// must outlive the graph (a string literal).
[[nodiscard]] Variable record(const char* name, Tensor value, std::vector<Variable> inputs,
                              Save save, std::vector<VjpRule> rules);

/// Records an op with one joint rule for all inputs. The node holds the inputs exactly as they are
/// passed, and the output if the rule reads it. At least one input must be tracked.
[[nodiscard]] Variable record(const char* name, Tensor value, std::vector<Node::Input> inputs,
                              JointVjpRule joint_rule, bool saves_output = false);

}  // namespace stymo
