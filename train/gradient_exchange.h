#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "core/tensor.h"
#include "train/ranks.h"

namespace stymo {

/// Adds up the gradients of a step over all ranks while other gradients are still computed. They
/// travel in buckets of parameters that follow each other, those of the last parameters first,
/// because the backward pass completes them first (Li et al. 2020, PyTorch Distributed). The sums
/// are those of `add_up` on all gradients at once, bit for bit. Meanwhile no other call may use the
/// ranks.
class GradientExchange {
public:
    static constexpr std::int64_t default_bucket_bytes = 1 << 20;

    /// `bytes` of the gradient of each parameter, the same on all ranks.
    GradientExchange(Ranks& ranks, const std::vector<std::int64_t>& bytes,
                     std::int64_t bucket_bytes = default_bucket_bytes);
    /// Waits for the bucket that is on its way, and sends no further ones.
    ~GradientExchange() = default;
    GradientExchange(const GradientExchange&) = delete;
    GradientExchange& operator=(const GradientExchange&) = delete;

    /// This rank's sum for parameter i, which arrives once. Thread-safe.
    void add(std::size_t i, Tensor sum);
    /// The sums over all ranks, after every parameter has arrived. Tells the ranks how much of the
    /// exchange was hidden behind other work. Throws what the exchange threw.
    [[nodiscard]] std::vector<Tensor> take_sums();

private:
    struct Bucket {
        std::size_t begin, end;  ///< parameters
        std::size_t missing;     ///< parameters that have not arrived
    };

    void run(const std::stop_token& stop);

    Ranks& ranks_;
    double exchanged_before_;  ///< seconds
    std::vector<Tensor> sums_;
    std::vector<Bucket> buckets_;         ///< in the order in which they travel
    std::vector<std::size_t> bucket_of_;  ///< for each parameter
    std::mutex mutex_;
    std::condition_variable_any arrived_;
    std::exception_ptr problem_;
    std::jthread thread_;  ///< ends before what it uses; not started for a single rank
};

}  // namespace stymo
