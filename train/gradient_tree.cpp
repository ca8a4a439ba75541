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
                waiting_.emplace(Place{i, level, number}, std::move(sum));
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
