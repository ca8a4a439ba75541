#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

class Vjp;

/// Vector-Jacobian product of an op with respect to one of its inputs: maps the gradient of the
/// output to the gradient of that input. It is written in ops, so that it can itself be
/// differentiated. An empty function means that the input has no gradient.
using VjpRule = std::function<Variable(const Vjp&)>;

/// Computes the gradients of all inputs at once, for an op whose rules share work. It is called
/// once in a backward pass and returns one gradient per input, in the order of the inputs.
/// Gradients that are not `needed` may be undefined.
using JointVjpRule =
    std::function<std::vector<Variable>(const Vjp&, const std::vector<bool>& needed)>;

/// The values that a rule may read, besides shapes. All other values are released as soon as the
/// forward pass no longer needs them.
struct Save {
    bool output = false;
    std::uint32_t inputs = 0;  ///< bit i: input i; if all bits are set, also every input from 32 on

    static constexpr Save none() { return {}; }
    static constexpr Save the_output() { return {true, 0}; }
    static constexpr Save all_inputs() { return {false, ~0U}; }
    static constexpr Save input(int i) { return {false, 1U << i}; }
    constexpr Save operator|(Save other) const {
        return {output || other.output, inputs | other.inputs};
    }
    [[nodiscard]] constexpr bool has_input(std::size_t i) const {
        return i < 32 ? ((inputs >> i) & 1U) != 0 : inputs == ~0U;
    }
};

/// One recorded operation. Holds its inputs' nodes and the values declared in Save. It never holds
/// a Variable of its own output, since that ownership cycle would never be released.
class Node {
public:
    struct Input {
        std::shared_ptr<Node> node;  ///< null for a constant
        Tensor value;                ///< undefined unless saved
        Shape shape;
    };

    Node(const char* name, std::vector<Input> inputs, std::vector<VjpRule> rules,
         Tensor saved_output);
    /// All inputs whose value is defined count as saved.
    Node(const char* name, std::vector<Input> inputs, JointVjpRule joint_rule, Tensor saved_output);
    ~Node();
    Node(const Node&) = delete;
    Node& operator=(const Node&) = delete;

    [[nodiscard]] const char* name() const { return name_; }
    [[nodiscard]] const std::vector<Input>& inputs() const { return inputs_; }
    /// One rule per input; empty if there is a joint rule.
    [[nodiscard]] const std::vector<VjpRule>& rules() const { return rules_; }
    [[nodiscard]] const JointVjpRule& joint_rule() const { return joint_rule_; }
    [[nodiscard]] const Tensor& saved_output() const { return saved_output_; }
    /// Greater than the number of every node made before, and so of its inputs.
    [[nodiscard]] std::int64_t number() const { return number_; }

    /// Number of nodes alive in the process. Tests use it to find leaks.
    [[nodiscard]] static std::int64_t live_count();

private:
    const char* name_;
    std::vector<Input> inputs_;
    std::vector<VjpRule> rules_;
    JointVjpRule joint_rule_;
    Tensor saved_output_;
    std::int64_t number_;
};

/// The arguments of a gradient rule. With create_graph the values are part of the graph, so that
/// the gradient can be differentiated; otherwise they are constants. The rule is the same in both
/// cases.
class Vjp {
public:
    Vjp(std::shared_ptr<Node> node, Variable output_gradient, bool create_graph)
        : node_(std::move(node)),
          output_gradient_(std::move(output_gradient)),
          create_graph_(create_graph) {}

    /// The gradient of the output.
    [[nodiscard]] const Variable& grad() const { return output_gradient_; }
    /// Throws GradientError if the op did not declare this save.
    [[nodiscard]] Variable input(std::size_t i) const;
    [[nodiscard]] Variable output() const;
    [[nodiscard]] const Shape& shape(std::size_t i) const { return node_->inputs().at(i).shape; }
    /// Whether the result of the rule may be differentiated. A fused rule must then use its
    /// reference implementation.
    [[nodiscard]] bool create_graph() const { return create_graph_; }

private:
    std::shared_ptr<Node> node_;
    Variable output_gradient_;
    bool create_graph_;
};

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
