#include "core/autograd/record.h"

#include <algorithm>

#include "core/error.h"
#include "core/work_counts.h"

namespace stymo {

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
    auto node = std::make_shared<Node>(name, std::move(edges), std::move(rules),
                                       std::move(saved_output), save);
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
