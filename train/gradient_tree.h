#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <tuple>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// Sums the gradients of a step's micro-batches along a fixed binary tree: micro-batches 2k and 2k
/// + 1 are added, then these sums in pairs, and so on. The result therefore does not depend on the
/// order in which the gradients arrive, and rounding errors grow with the logarithm of the number
/// of micro-batches.
class GradientTree {
public:
    /// Receives the sum of the gradients of parameter i.
    using SumSink = std::function<void(std::size_t i, Tensor sum)>;

    /// `sink` is called once for each parameter, by the thread that completes its sum.
    GradientTree(std::int64_t micro_batches, SumSink sink);

    /// Adds the gradient of parameter i in one micro-batch; must be called once for each pair.
    /// Thread-safe.
    void add(std::int64_t micro_batch, std::size_t i, Tensor gradient);
    /// Largest number of gradient sets in memory at the same time if `at_once` micro-batches are
    /// computed concurrently, in order.
    [[nodiscard]] static std::int64_t most_sets(std::int64_t micro_batches, std::int64_t at_once);

private:
    /// Parameter, level of the tree, and number within the level.
    using TreeNode = std::tuple<std::size_t, std::int64_t, std::int64_t>;

    std::int64_t micro_batches_;
    SumSink sink_;
    std::mutex mutex_;
    std::map<TreeNode, Tensor> waiting_;  ///< sums whose partner has not arrived
};

}  // namespace stymo
