#include "core/autograd/grad.h"

#include <algorithm>
#include <unordered_map>

#include "core/autograd/node.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/work_counts.h"

namespace stymo {

namespace {

struct Visit {
    std::shared_ptr<Node> node;
    bool needed = false;  ///< lies on a path to one of the xs
};

using Targets = std::unordered_map<const Node*, std::size_t>;

/// Nodes behind `root`, every node after all of its inputs, with an explicit stack: graphs may be a
/// million ops deep.
std::vector<Visit> topological_order(const std::shared_ptr<Node>& root, const Targets& targets,
                                     bool end_at_targets) {
    struct Frame {
        std::shared_ptr<Node> node;
        std::size_t next_input = 0;
    };
    std::vector<Visit> order;
    std::unordered_map<const Node*, std::size_t> position;
    std::vector<Frame> stack{{root}};
    constexpr auto open = static_cast<std::size_t>(-1);
    position.emplace(root.get(), open);
    while (!stack.empty()) {
        Frame& frame = stack.back();
        const auto& inputs = frame.node->inputs();
        const bool is_target = targets.contains(frame.node.get());
        if (frame.next_input < inputs.size() && !(is_target && end_at_targets)) {
            const std::shared_ptr<Node>& input = inputs[frame.next_input++].node;
            if (input && position.emplace(input.get(), open).second) stack.push_back({input});
            continue;
        }
        const bool needed = is_target || std::ranges::any_of(inputs, [&](const Node::Input& input) {
                                return input.node && order[position.at(input.node.get())].needed;
                            });
        position.at(frame.node.get()) = order.size();
        order.push_back({frame.node, needed});
        stack.pop_back();
    }
    return order;
}

Variable initial_gradient(const Variable& y, const GradOptions& options) {
    if (options.dL_dy.defined()) {
        if (options.dL_dy.shape() != y.shape())
            fail<ShapeError>("[grad] dL_dy has shape ", options.dL_dy.shape(), ", y has ",
                             y.shape());
        return options.create_graph ? options.dL_dy : options.dL_dy.detach();
    }
    if (y.value().size() != 1)
        fail<GradientError>("[grad] y has shape ", y.shape(), "; give a scalar, or dL_dy");
    return Variable(Tensor::full(y.shape(), 1.0, y.dtype()));
}

class Sweep {
public:
    Sweep(std::vector<Visit> order, const GradOptions& options)
        : order_(std::move(order)),
          create_graph_(options.create_graph),
          end_at_targets_(options.partial) {
        for (const Visit& visit : order_) needed_.emplace(visit.node.get(), visit.needed);
    }

    /// Gradients of the target nodes, in their order; undefined where no gradient arrived.
    std::vector<Variable> run(Variable dL_dy, const Targets& targets) {
        std::vector<Variable> results(targets.size());
        if (!order_.back().needed) return results;
        gradients_[order_.back().node.get()] = std::move(dL_dy);
        for (auto visit = order_.rbegin(); visit != order_.rend(); ++visit) {
            const auto arrived = gradients_.find(visit->node.get());
            if (arrived == gradients_.end()) continue;
            Variable gradient = std::move(arrived->second);
            gradients_.erase(arrived);
            if (const auto target = targets.find(visit->node.get()); target != targets.end()) {
                results[target->second] = gradient;
                if (end_at_targets_) continue;
            }
            propagate(visit->node, std::move(gradient));
        }
        return results;
    }

private:
    void propagate(const std::shared_ptr<Node>& node, Variable gradient) {
        const Vjp vjp(node, std::move(gradient), create_graph_);
        std::vector<bool> needed;
        for (const Node::Input& input : node->inputs())
            needed.push_back(input.node && needed_.at(input.node.get()));
        std::vector<Variable> together;
        if (node->joint_rule() && std::ranges::count(needed, true) > 0)
            together = node->joint_rule()(vjp, needed);
        for (std::size_t i = 0; i < needed.size(); ++i) {
            if (!needed[i]) continue;
            work::count_gradient_rule();
            if (node->joint_rule()) {
                accumulate(*node, i, std::move(together.at(i)));
                continue;
            }
            if (!node->rules()[i])
                fail<GradientError>("[", node->name(), "] has no gradient for input ", i);
            accumulate(*node, i, node->rules()[i](vjp));
        }
    }

    void accumulate(const Node& node, std::size_t i, Variable contribution) {
        const Node::Input& input = node.inputs()[i];
        if (contribution.shape() != input.shape) {
            fail<ShapeError>("[", node.name(), "] the rule of input ", i, " returned ",
                             contribution.shape(), " for an input of ", input.shape);
        }
        Variable& sum = gradients_[input.node.get()];
        sum = sum.defined() ? add(sum, contribution) : std::move(contribution);
    }

    std::vector<Visit> order_;
    bool create_graph_;
    bool end_at_targets_;
    std::unordered_map<const Node*, bool> needed_;
    std::unordered_map<const Node*, Variable> gradients_;
};

}  // namespace

std::vector<Variable> grad(const Variable& y, std::span<const Variable> xs,
                           const GradOptions& options) {
    Targets targets;
    for (const Variable& x : xs) {
        if (!x.tracked())
            fail<GradientError>("[grad] asked for the gradient of a constant of shape ", x.shape());
        targets.emplace(x.node().get(), targets.size());
    }
    Variable dL_dy = initial_gradient(y, options);
    std::vector<Variable> by_target(targets.size());
    if (y.tracked()) {
        by_target = Sweep(topological_order(y.node(), targets, options.partial), options)
                        .run(std::move(dL_dy), targets);
    }
    work::count_gradients(std::ranges::count_if(by_target, &Variable::defined));
    std::vector<Variable> result;
    result.reserve(xs.size());
    for (const Variable& x : xs) {
        const Variable& gradient = by_target[targets.at(x.node().get())];
        result.push_back(gradient.defined() ? gradient
                                            : Variable(Tensor::zeros(x.shape(), x.dtype())));
    }
    return result;
}

Variable grad(const Variable& y, const Variable& x, const GradOptions& options) {
    return grad(y, std::span(&x, 1), options).front();
}

}  // namespace stymo
