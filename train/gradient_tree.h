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

/// The sums of the gradients of a step's micro-batches, each along one fixed binary tree:
/// micro-batches 2k and 2k + 1 are added, then these sums in pairs, and so on. So the bits do not
/// depend on the order in which the gradients arrive, and rounding errors grow with the logarithm
/// of the number of micro-batches.
class GradientTree {
public:
    /// Takes the sum of the gradients of parameter i.
    using SumSink = std::function<void(std::size_t i, Tensor sum)>;

    /// `sink` is called once for each parameter, by the thread that completes its sum.
    GradientTree(std::int64_t micro_batches, SumSink sink);

    /// The gradient of parameter i in one micro-batch, which arrives once. Thread-safe.
    void add(std::int64_t micro_batch, std::size_t i, Tensor gradient);
    /// Sets of gradients that are there at the same time at most, if `at_once` micro-batches are
    /// computed side by side in their order.
    [[nodiscard]] static std::int64_t most_sets(std::int64_t micro_batches, std::int64_t at_once);

private:
    /// Parameter, level, and number within the level.
    using Place = std::tuple<std::size_t, std::int64_t, std::int64_t>;

    std::int64_t micro_batches_;
    SumSink sink_;
    std::mutex mutex_;
    std::map<Place, Tensor> waiting_;  ///< for the other half of a pair
};

}  // namespace stymo
