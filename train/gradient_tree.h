#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo {

/// The sum of the gradients of a step's micro-batches along one fixed binary tree: micro-batches 2k
/// and 2k + 1 are added, then these sums in pairs, and so on. So the bits do not depend on the
/// order in which the gradients arrive, and rounding errors grow with the logarithm of the number
/// of micro-batches.
class GradientTree {
public:
    explicit GradientTree(std::int64_t micro_batches);

    /// The gradients of one micro-batch, each of which arrives once. Thread-safe.
    void add(std::int64_t micro_batch, const std::vector<Variable>& gradients);
    /// After the last one has arrived.
    [[nodiscard]] std::vector<Tensor> take_sum() { return std::move(root_); }
    /// Sets of gradients that are there at the same time at most, if `at_once` micro-batches are
    /// computed side by side in their order.
    [[nodiscard]] static std::int64_t most_sets(std::int64_t micro_batches, std::int64_t at_once);

private:
    using Sum = std::vector<Tensor>;
    /// Level and number within the level.
    using Place = std::pair<std::int64_t, std::int64_t>;

    std::int64_t micro_batches_;
    std::mutex mutex_;
    std::map<Place, Sum> waiting_;  ///< for the other half of a pair
    Sum root_;
};

}  // namespace stymo
