#include <algorithm>
#include <catch2/catch.hpp>
#include <numeric>
#include <vector>

#include "core/ops/elementwise.h"
#include "core/parallel.h"
#include "core/rng.h"
#include "support/check_close.h"
#include "support/gradient_sums.h"
#include "support/thread_count.h"
#include "train/gradient_sums.h"
#include "train/stage.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// Gradients of two parameters, different for each micro-batch.
std::vector<Variable> gradients_of(std::int64_t micro_batch) {
    Rng rng = Rng(7).split(static_cast<std::uint64_t>(micro_batch));
    return {rng.uniform({3, 5}, -1.0, 1.0), rng.uniform({7}, 0.0, 1e-3)};
}

std::vector<std::int64_t> numbers_below(std::int64_t count) {
    std::vector<std::int64_t> numbers(static_cast<std::size_t>(count));
    std::iota(numbers.begin(), numbers.end(), 0);
    return numbers;
}

}  // namespace

TEST_CASE("the sum of any number of micro-batches keeps the precision of float32") {
    for (const std::int64_t count : {1, 8, 63, 64, 100000}) {
        GradientSums tree(count);
        const Tensor gradient = Rng(1).uniform({4}, 0.5, 1.5);
        for (std::int64_t i = 0; i < count; ++i) tree.add(i, {gradient});
        INFO(count << " micro-batches");
        const std::vector<double> sum = tree.take_sum().front().to_vector();
        for (std::size_t i = 0; i < 4; ++i)
            CHECK(sum[i] / static_cast<double>(count) ==
                  Approx(gradient.to_vector()[i]).epsilon(2e-6));
    }
}

TEST_CASE("gradients add up to the same bits in whatever order they arrive") {
    for (const std::int64_t count : {2, 5, 8, 13}) {
        GradientSums in_order(count), reversed(count), by_threads(count);
        for (const std::int64_t i : numbers_below(count)) {
            in_order.add(i, gradients_of(i));
            reversed.add(count - 1 - i, gradients_of(count - 1 - i));
        }
        parallel_for(count, 1,
                     [&](std::int64_t i, std::int64_t) { by_threads.add(i, gradients_of(i)); });
        const std::vector<Tensor> expected = in_order.take_sum();
        CHECK(all_identical(expected, reversed.take_sum()));
        CHECK(all_identical(expected, by_threads.take_sum()));
    }
}

TEST_CASE("a sum along the tree is the sum of the sums of its halves") {
    GradientSums whole(8), first(4), second(4);
    for (const std::int64_t i : numbers_below(8)) {
        whole.add(i, gradients_of(i));
        (i < 4 ? first : second).add(i % 4, gradients_of(i));
    }
    std::vector<Tensor> halves;
    const std::vector<Tensor> left = first.take_sum(), right = second.take_sum();
    for (std::size_t k = 0; k < 2; ++k)
        halves.push_back((Variable(left[k]) + Variable(right[k])).value());
    CHECK(all_identical(whole.take_sum(), halves));
}

TEST_CASE("micro-batches run side by side where there are enough for all threads") {
    const ThreadCount before;
    set_thread_count(2);
    for (const bool side_by_side : {false, true}) {
        std::vector<int> calls(5);
        for_each_micro_batch(5, side_by_side,
                             [&](std::int64_t i) { ++calls[static_cast<std::size_t>(i)]; });
        CHECK(std::ranges::all_of(calls, [](int count) { return count == 1; }));
    }
    CHECK(GradientTree::most_sets(1, 1) == 1);
    CHECK(GradientTree::most_sets(8, 2) == 5);
    CHECK(GradientTree::most_sets(2, 2) == 2);
}
