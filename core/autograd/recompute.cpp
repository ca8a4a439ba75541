#include "core/autograd/recompute.h"

#include <memory>
#include <unordered_set>

#include "core/autograd/grad.h"
#include "core/autograd/node.h"
#include "core/error.h"
#include "core/ops/elementwise.h"

namespace stymo {

namespace {

/// A node between the segment and one of its inputs. All nodes before it belong to the surrounding
/// graph.
Variable entrance(const Variable& x) {
    return record("recompute_input", x.value(), {x}, Save::none(),
                  {[](const Vjp& v) { return v.grad(); }});
}

using Nodes = std::unordered_set<const Node*>;

Nodes nodes_of(const std::vector<Variable>& variables) {
    Nodes nodes;
    for (const Variable& variable : variables) nodes.insert(variable.node().get());
    return nodes;
}

/// The graph between the result of a segment and its entrances.
struct SegmentGraph {
    std::vector<Node::Input> leaves;              ///< each once
    std::vector<std::weak_ptr<Node>> operations;  ///< entrances included
};

SegmentGraph explore(const Variable& result, const std::vector<Variable>& entrances) {
    const Nodes ends = nodes_of(entrances);
    SegmentGraph graph;
    Nodes seen{result.node().get()};
    std::vector<Node::Input> pending{{result.node(), {}, result.shape()}};
    while (!pending.empty()) {
        Node::Input next = std::move(pending.back());
        pending.pop_back();
        const Node& node = *next.node;
        if (node.inputs().empty()) {
            graph.leaves.push_back(std::move(next));
            continue;
        }
        graph.operations.push_back(next.node);
        if (ends.contains(&node)) continue;
        for (const Node::Input& input : node.inputs()) {
            if (input.node && seen.insert(input.node.get()).second)
                pending.push_back({input.node, {}, input.shape});
        }
    }
    return graph;
}

/// A node that outlives the segment's own variables has another owner: the segment took it from
/// outside, or let it escape.
void require_closed(const SegmentGraph& graph) {
    for (const std::weak_ptr<Node>& operation : graph.operations) {
        const std::shared_ptr<Node> alive = operation.lock();
        if (alive) {
            fail<GradientError>("[recompute] the segment shares the result of [", alive->name(),
                                "] with the graph around it; pass it as an input");
        }
    }
}

/// Gradients of the needed inputs and leaves, inputs first.
std::vector<Variable> gradients(const Segment& segment, std::size_t input_count,
                                const std::vector<Variable>& leaves, const Vjp& v,
                                const std::vector<bool>& needed) {
    std::vector<Variable> arguments;
    std::vector<Variable> xs;
    for (std::size_t i = 0; i < input_count; ++i) {
        Variable input = v.input(i);
        if (needed[i] && !input.tracked()) input = Variable::leaf(input.value());
        if (input.tracked()) input = entrance(input);
        if (needed[i]) xs.push_back(input);
        arguments.push_back(std::move(input));
    }
    for (std::size_t i = 0; i < leaves.size(); ++i) {
        if (needed[input_count + i]) xs.push_back(leaves[i]);
    }
    const Variable result = segment(arguments);
    Nodes reached;
    if (result.tracked()) {
        for (const Node::Input& leaf : explore(result, arguments).leaves)
            reached.insert(leaf.node.get());
    }
    for (const Variable& x : xs) {
        if (x.node()->inputs().empty() && !reached.contains(x.node().get()))
            fail<GradientError>(
                "[recompute] the segment does not reach a leaf any more that it reached before");
    }
    const std::vector<Variable> found =
        grad(result, xs, {.create_graph = v.create_graph(), .partial = true, .dL_dy = v.grad()});
    std::vector<Variable> all(needed.size());
    std::size_t next = 0;
    for (std::size_t i = 0; i < needed.size(); ++i) {
        if (needed[i]) all[i] = found[next++];
    }
    return all;
}

}  // namespace

Variable recompute(const Segment& segment, std::vector<Variable> inputs) {
    SegmentGraph graph;
    Tensor value;
    {
        std::vector<Variable> arguments;
        for (const Variable& input : inputs)
            arguments.push_back(input.tracked() ? entrance(Variable::leaf(input.value())) : input);
        const Variable result = segment(arguments);
        if (!result.tracked()) return result;
        graph = explore(result, arguments);
        value = result.value();
    }
    require_closed(graph);
    std::vector<Node::Input> edges;
    for (Variable& input : inputs) edges.push_back({input.node(), input.value(), input.shape()});
    std::vector<Variable> leaves;
    for (Node::Input& leaf : graph.leaves) {
        leaves.emplace_back(Tensor{}, leaf.node);
        edges.push_back(std::move(leaf));
    }
    return record("recompute", std::move(value), std::move(edges),
                  [segment, input_count = inputs.size(), leaves = std::move(leaves)](
                      const Vjp& v, const std::vector<bool>& needed) {
                      return gradients(segment, input_count, leaves, v, needed);
                  });
}

Variable differentiate_at_once(const std::function<Variable(const Variable&)>& function,
                               const Variable& x) {
    if (!x.tracked()) return function(x).detach();
    const Variable argument = Variable::leaf(x.value());
    const Variable y = function(argument);
    const Tensor gradient = grad(y, argument).value();
    return record(
        "differentiate_at_once", y.value(), {x}, Save::none(), {[gradient](const Vjp& v) {
            if (v.create_graph())
                fail<GradientError>("[differentiate_at_once] has no derivatives beyond the first");
            return v.grad() * Variable(gradient);
        }});
}

}  // namespace stymo
