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

/// Sums the gradients of a step over all ranks while other gradients are still being computed.
/// Gradients are sent in buckets of consecutive parameters. The last parameters are sent first,
/// because the backward pass completes them first (Li et al. 2020, PyTorch Distributed). The sums
/// have the same bits as those of `add_up`. During its lifetime no other call may use the ranks.
class GradientExchange {
public:
    static constexpr std::int64_t default_bucket_bytes = 1 << 20;

    /// `bytes` is the size of each parameter's gradient, the same on all ranks.
    GradientExchange(Ranks& ranks, const std::vector<std::int64_t>& bytes,
                     std::int64_t bucket_bytes = default_bucket_bytes);
    /// Waits for the bucket that is being sent, and sends no further ones.
    ~GradientExchange() = default;
    GradientExchange(const GradientExchange&) = delete;
    GradientExchange& operator=(const GradientExchange&) = delete;

    /// Adds this rank's sum for parameter i; must be called once for each. Thread-safe.
    void add(std::size_t i, Tensor sum);
    /// Waits for the exchange and returns the sums over all ranks. `add` must have been called for
    /// every parameter. Adds the time that was hidden behind computations to Ranks::hidden_seconds.
    /// Rethrows an exception of the exchange.
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
    std::vector<Bucket> buckets_;         ///< in the order in which they are sent
    std::vector<std::size_t> bucket_of_;  ///< for each parameter
    std::mutex mutex_;
    std::condition_variable_any arrived_;
    std::exception_ptr problem_;
    std::jthread thread_;  ///< last member, so that it ends before the data that it uses; not
                           ///< started for a single rank
};

}  // namespace stymo
