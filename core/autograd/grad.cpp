// Reverse-mode differentiation over a recorded graph.
//
// A node's gradient may be passed on only when it is complete: when every node that reads its
// output has contributed. Nodes are therefore visited in reverse topological order. That order is
// the order of creation, and no search is needed to find it: a node receives its inputs in its
// constructor and never changes them, so they all exist before it and have smaller numbers. The
// numbers come from one atomic counter; a thread that uses another thread's node as an input has
// seen it made, and draws a larger number. Sorting the nodes behind y by number is thus a
// topological sort, also if several threads recorded the graph, and needs no recursion, which would
// overflow the stack on long graphs.
//
// Going up in this order, a node is needed if it is a target or if one of its inputs is needed;
// only the rules of needed inputs run. Going down, gradients are passed from each node to its
// inputs. Contributions are added in this order, so a graph that one thread records gives the same
// bits in every run.
//
// Leaves are an exception to the order. A parameter was created before everything else, so it would
// come last, and its gradient would wait in memory until the sweep ends. But a count of missing
// contributions tells when it is complete, and it is then handed to the sink at once
// (`grad_in_turn` relies on it to overlap the backward pass with the exchange between machines).
//
// Rules call ops, so the backward pass can be recorded like any other computation. With
// `create_graph` the gradients are themselves variables, which gives derivatives of every order.

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

/// All nodes on which `root` depends, in the order of their creation, so that every node comes
/// after its inputs. No recursion, because graphs may be a million ops deep.
std::vector<Visit> nodes_behind(const std::shared_ptr<Node>& root, const Targets& targets,
                                bool end_at_targets) {
    std::unordered_map<const Node*, bool> needed{{root.get(), false}};
    std::vector<std::shared_ptr<Node>> pending{root};
    std::vector<Visit> order;
    while (!pending.empty()) {
        order.push_back({std::move(pending.back())});
        pending.pop_back();
        if (end_at_targets && targets.contains(order.back().node.get())) continue;
        for (const Node::Input& input : order.back().node->inputs())
            if (input.node && needed.emplace(input.node.get(), false).second)
                pending.push_back(input.node);
    }
    std::ranges::sort(order, {}, [](const Visit& visit) { return visit.node->number(); });
    const auto leads_to_target = [&](const Node::Input& input) {
        const auto found = needed.find(input.node.get());
        return found != needed.end() && found->second;
    };
    for (Visit& visit : order) {
        visit.needed = targets.contains(visit.node.get()) ||
                       std::ranges::any_of(visit.node->inputs(), leads_to_target);
        needed.at(visit.node.get()) = visit.needed;
    }
    return order;
}

Variable initial_gradient(const Variable& y, const GradOptions& options) {
    if (options.dL_dy.defined()) {
        if (options.dL_dy.shape() != y.shape())
            fail<ShapeError>("[grad] dL_dy has shape ", options.dL_dy.shape(), ", y has ",
                             y.shape());
        if (options.dL_dy.dtype() != y.dtype())
            fail<TypeError>("[grad] dL_dy is ", options.dL_dy.dtype(), ", y ", y.dtype());
        return options.create_graph ? options.dL_dy : options.dL_dy.detach();
    }
    if (y.value().size() != 1)
        fail<GradientError>("[grad] y has shape ", y.shape(), "; give a scalar, or dL_dy");
    return Variable(Tensor::full(y.shape(), 1.0, y.dtype()));
}

class Sweep {
public:
    Sweep(std::vector<Visit> order, const Targets& targets, const GradientSink& sink,
          const GradOptions& options)
        : order_(std::move(order)),
          targets_(targets),
          sink_(sink),
          create_graph_(options.create_graph),
          end_at_targets_(options.partial) {
        for (const Visit& visit : order_) needed_.emplace(visit.node.get(), visit.needed);
        for (const Visit& visit : order_) {
            if (end_at_targets_ && targets_.contains(visit.node.get())) continue;
            for (const Node::Input& input : visit.node->inputs())
                if (input.node && needed_.at(input.node.get())) ++missing_[input.node.get()];
        }
    }

    /// Passes the gradients of the target nodes to the sink. Targets that y does not depend on are
    /// skipped.
    void run(Variable dL_dy) {
        if (!order_.back().needed) return;
        gradients_[order_.back().node.get()] = std::move(dL_dy);
        for (auto visit = order_.rbegin(); visit != order_.rend(); ++visit) {
            const auto arrived = gradients_.find(visit->node.get());
            if (arrived == gradients_.end()) continue;
            Variable gradient = std::move(arrived->second);
            gradients_.erase(arrived);
            if (const auto target = targets_.find(visit->node.get()); target != targets_.end()) {
                sink_(target->second, gradient);
                if (end_at_targets_) continue;
            }
            propagate(visit->node, std::move(gradient));
        }
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
        if (contribution.shape() != input.shape)
            fail<ShapeError>("[", node.name(), "] the rule of input ", i, " returned ",
                             contribution.shape(), " for an input of ", input.shape);
        const auto entry = gradients_.try_emplace(input.node.get()).first;
        Variable& sum = entry->second;
        sum = sum.defined() ? add(sum, contribution) : std::move(contribution);
        // A complete gradient of a leaf is passed on at once, since a leaf may come late in the
        // order.
        if (--missing_.at(input.node.get()) > 0 || !input.node->inputs().empty()) return;
        sink_(targets_.at(input.node.get()), std::move(sum));
        gradients_.erase(entry);
    }

    std::vector<Visit> order_;
    const Targets& targets_;
    const GradientSink& sink_;
    bool create_graph_;
    bool end_at_targets_;
    std::unordered_map<const Node*, bool> needed_;
    /// Contributions that a gradient still lacks.
    std::unordered_map<const Node*, std::size_t> missing_;
    std::unordered_map<const Node*, Variable> gradients_;
};

Targets targets_of(std::span<const Variable> xs) {
    Targets targets;
    for (const Variable& x : xs) {
        if (!x.tracked())
            fail<GradientError>("[grad] asked for the gradient of a constant of shape ", x.shape());
        targets.emplace(x.node().get(), targets.size());
    }
    return targets;
}

/// Passes the gradients of the targets that y depends on to the sink.
void sweep(const Variable& y, const Targets& targets, const GradientSink& sink,
           const GradOptions& options) {
    Variable dL_dy = initial_gradient(y, options);
    if (!y.tracked()) return;
    std::int64_t count = 0;
    const GradientSink counted = [&](std::size_t target, Variable gradient) {
        ++count;
        sink(target, std::move(gradient));
    };
    Sweep(nodes_behind(y.node(), targets, options.partial), targets, counted, options)
        .run(std::move(dL_dy));
    work::count_gradients(count);
}

Variable zeros_like(const Variable& x) {
    return Variable(Tensor::zeros(x.shape(), x.dtype()));
}

}  // namespace

std::vector<Variable> grad(const Variable& y, std::span<const Variable> xs,
                           const GradOptions& options) {
    const Targets targets = targets_of(xs);
    std::vector<Variable> by_target(targets.size());
    sweep(
        y, targets,
        [&](std::size_t target, Variable gradient) { by_target[target] = std::move(gradient); },
        options);
    std::vector<Variable> result;
    result.reserve(xs.size());
    for (const Variable& x : xs) {
        const Variable& gradient = by_target[targets.at(x.node().get())];
        result.push_back(gradient.defined() ? gradient : zeros_like(x));
    }
    return result;
}

Variable grad(const Variable& y, const Variable& x, const GradOptions& options) {
    return grad(y, std::span(&x, 1), options).front();
}

void grad_in_turn(const Variable& y, std::span<const Variable> xs, const GradientSink& sink,
                  const GradOptions& options) {
    const Targets targets = targets_of(xs);
    if (targets.size() != xs.size())
        fail<GradientError>("[grad] asked for the gradient of the same variable twice");
    std::vector<bool> arrived(xs.size());
    sweep(
        y, targets,
        [&](std::size_t i, Variable gradient) {
            arrived[i] = true;
            sink(i, std::move(gradient));
        },
        options);
    for (std::size_t i = 0; i < xs.size(); ++i)
        if (!arrived[i]) sink(i, zeros_like(xs[i]));
}

}  // namespace stymo
