#include "core/autograd/node.h"

#include <algorithm>
#include <atomic>

#include "core/error.h"
#include "core/sole_owner.h"
#include "core/work_counts.h"

namespace stymo {

namespace {

std::atomic<std::int64_t> created_nodes{0};
std::atomic<std::int64_t> live_nodes{0};

}  // namespace

Node::Node(const char* name, std::vector<Input> inputs, std::vector<VjpRule> rules,
           Tensor saved_output)
    : name_(name),
      inputs_(std::move(inputs)),
      rules_(std::move(rules)),
      saved_output_(std::move(saved_output)),
      number_(created_nodes++) {
    ++live_nodes;
}

Node::Node(const char* name, std::vector<Input> inputs, JointVjpRule joint_rule,
           Tensor saved_output)
    : name_(name),
      inputs_(std::move(inputs)),
      joint_rule_(std::move(joint_rule)),
      saved_output_(std::move(saved_output)),
      number_(created_nodes++) {
    ++live_nodes;
}

/// Releases the graph behind this node in a loop: the default, one destructor inside the other,
/// overflows the stack on a chain of some ten thousand ops.
Node::~Node() {
    --live_nodes;
    std::vector<std::shared_ptr<Node>> pending;
    const auto take_inputs = [&pending](Node& node) {
        for (Input& input : node.inputs_) {
            if (input.node) pending.push_back(std::move(input.node));
        }
        // Rules may hold inputs too. Releasing the rules while `pending` still owns these inputs
        // releases the inputs one by one.
        node.rules_.clear();
        node.joint_rule_ = nullptr;
    };
    take_inputs(*this);
    while (!pending.empty()) {
        const std::shared_ptr<Node> node = std::move(pending.back());
        pending.pop_back();
        if (is_sole_owner(node)) take_inputs(*node);
    }
}

std::int64_t Node::live_count() {
    return live_nodes;
}

Variable Variable::leaf(Tensor value) {
    return {std::move(value),
            std::make_shared<Node>("leaf", std::vector<Node::Input>{}, std::vector<VjpRule>{},
                                   Tensor{})};
}

Variable Vjp::input(std::size_t i) const {
    const Node::Input& input = node_->inputs().at(i);
    if (!input.value.defined())
        fail<GradientError>("[", node_->name(), "] the rule reads input ", i,
                            ", which was not saved");
    return create_graph_ ? Variable(input.value, input.node) : Variable(input.value);
}

Variable Vjp::output() const {
    if (!node_->saved_output().defined())
        fail<GradientError>("[", node_->name(), "] the rule reads the output, which was not saved");
    return create_graph_ ? Variable(node_->saved_output(), node_) : Variable(node_->saved_output());
}

Variable record(const char* name, Tensor value, std::vector<Variable> inputs, Save save,
                std::vector<VjpRule> rules) {
    if (rules.size() != inputs.size())
        fail<GradientError>("[", name, "] has ", inputs.size(), " inputs but ", rules.size(),
                            " rules");
    work::count_operation();
    if (std::ranges::none_of(inputs, &Variable::tracked)) return Variable(std::move(value));
    std::vector<Node::Input> edges;
    edges.reserve(inputs.size());
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        edges.push_back({inputs[i].node(), save.has_input(i) ? inputs[i].value() : Tensor{},
                         inputs[i].shape()});
    }
    Tensor saved_output = save.output ? value : Tensor{};
    auto node =
        std::make_shared<Node>(name, std::move(edges), std::move(rules), std::move(saved_output));
    return {std::move(value), std::move(node)};
}

Variable record(const char* name, Tensor value, std::vector<Node::Input> inputs,
                JointVjpRule joint_rule, bool saves_output) {
    work::count_operation();
    auto node = std::make_shared<Node>(name, std::move(inputs), std::move(joint_rule),
                                       saves_output ? value : Tensor{});
    return {std::move(value), std::move(node)};
}

}  // namespace stymo
