#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <utility>
#include <vector>

#include "train/gradient_sums.h"

namespace stymo::test {

/// The sums of a GradientTree in the order of the parameters.
class GradientSums {
public:
    explicit GradientSums(std::int64_t micro_batches)
        : tree_(micro_batches, [this](std::size_t i, Tensor sum) {
              const std::lock_guard lock(mutex_);
              if (sums_.size() <= i) sums_.resize(i + 1);
              sums_[i] = std::move(sum);
          }) {}

    /// All gradients of one micro-batch.
    void add(std::int64_t micro_batch, const std::vector<Variable>& gradients) {
        for (std::size_t i = 0; i < gradients.size(); ++i)
            tree_.add(micro_batch, i, gradients[i].value());
    }
    [[nodiscard]] std::vector<Tensor> take_sum() { return std::move(sums_); }

private:
    std::mutex mutex_;
    std::vector<Tensor> sums_;
    GradientTree tree_;
};

}  // namespace stymo::test
