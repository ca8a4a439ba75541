// The sum of a step's gradients.
//
// A step's gradient is the sum over its micro-batches, which several threads, and several machines,
// compute in any order. Addition of floating-point numbers is not associative: a sum in the order
// of arrival would differ from run to run, and one in a fixed order of a list would make threads
// wait for each other. A run could then not be repeated, nor resumed with the same bits.
//
// The order is therefore that of a binary tree whose leaves are the micro-batches: 2k and 2k + 1
// are added, then these sums in pairs, and so on; the last of an odd number moves up unchanged.
// Which two sums are added depends on their numbers alone. Whoever arrives second at an inner node
// adds and goes on up, so nobody waits.
//
// The tree has two more advantages over a running sum. Its rounding error grows with the logarithm
// of the number of micro-batches. And a rank that computes a power of two of consecutive
// micro-batches holds a whole subtree, whose root alone it exchanges; the ranks' sums continue in
// the same tree
// (`add_up`), so the result does not depend on how many machines there are.
//
// The price is memory. A sum waits for its partner, one for each level that is incomplete: if
// micro-batches are computed in order, that is at most their logarithm, plus those that are being
// computed (`most_sets`). Each parameter has a tree of its own, so a parameter's sum is exchanged
// as soon as it is complete, while the backward pass goes on.

#include "train/gradient_tree.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "core/parallel.h"

namespace stymo {

namespace {

void add_to(Tensor& sum, const Tensor& more) {
    constexpr std::int64_t grain = 65536;
    dispatch(sum.dtype(), [&]<class T>(T) {
        T* const to = sum.mutable_values<T>().data();
        const T* const from = more.values<T>().data();
        parallel_for(sum.size(), grain, [=](std::int64_t begin, std::int64_t end) {
#pragma omp simd
            for (std::int64_t i = begin; i < end; ++i) to[i] += from[i];
        });
    });
}

}  // namespace

GradientTree::GradientTree(std::int64_t micro_batches, SumSink sink)
    : micro_batches_(micro_batches), sink_(std::move(sink)) {}

void GradientTree::add(std::int64_t micro_batch, std::size_t i, Tensor gradient) {
    Tensor sum = std::move(gradient);
    std::int64_t level = 0, number = micro_batch;
    for (std::int64_t width = micro_batches_; width > 1; width = (width + 1) / 2) {
        // The last of an odd number of sums has no partner and moves up unchanged.
        if (const std::int64_t partner = number ^ 1; partner < width) {
            std::unique_lock lock(mutex_);
            const auto found = waiting_.find({i, level, partner});
            if (found == waiting_.end()) {
                waiting_.emplace(TreeNode{i, level, number}, std::move(sum));
                return;
            }
            Tensor other = std::move(found->second);
            waiting_.erase(found);
            lock.unlock();
            // No one else shares the waiting sum, so it is changed in place.
            add_to(other, sum);
            sum = std::move(other);
        }
        ++level;
        number /= 2;
    }
    sink_(i, std::move(sum));
}

std::int64_t GradientTree::most_sets(std::int64_t micro_batches, std::int64_t at_once) {
    const auto levels =
        static_cast<std::int64_t>(std::bit_width(static_cast<std::uint64_t>(micro_batches - 1)));
    return std::min(micro_batches, levels + at_once);
}

}  // namespace stymo
