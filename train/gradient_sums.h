#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "core/autograd/variable.h"
#include "core/tensor.h"

/// The gradients of a step are added over the micro-batches of a process (GradientTree) and then
/// over the processes (add_up), in buckets while others are still being computed
/// (GradientExchange). All of it follows one binary tree, so that the sum has the same bits however
/// the work is divided.
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

/// One of the processes (MPI ranks) that train a model together. Each computes its share of every
/// batch's gradients and then makes the same update, so the weights are always the same on all
/// ranks. Only the first rank writes files. All ranks must make the calls below in the same order
/// and one at a time, from any thread.
class Ranks {
public:
    virtual ~Ranks() = default;

    [[nodiscard]] virtual int rank() const = 0;
    [[nodiscard]] virtual int size() const = 0;
    /// Sends `bytes` to rank `to`, and returns when `bytes` may be changed.
    virtual void send(std::span<const std::byte> bytes, int to) = 0;
    /// Receives from rank `from`; `bytes` must have the size that it sends.
    virtual void receive(std::span<std::byte> bytes, int from) = 0;
    /// Sends and receives at once; rank `other` must make the same call.
    virtual void exchange(std::span<const std::byte> sent, std::span<std::byte> received,
                          int other);
    /// Seconds spent in these calls so far, including waiting for other ranks.
    [[nodiscard]] virtual double exchange_seconds() const { return 0.0; }
    /// The part of exchange_seconds() in which this rank was also computing.
    [[nodiscard]] double hidden_seconds() const { return hidden_seconds_; }
    void add_hidden_seconds(double seconds) { hidden_seconds_ += seconds; }

    [[nodiscard]] bool leads() const { return rank() == 0; }

private:
    double hidden_seconds_ = 0.0;
};

/// The only process of a training.
class OneRank final : public Ranks {
public:
    [[nodiscard]] int rank() const override { return 0; }
    [[nodiscard]] int size() const override { return 1; }
    void send(std::span<const std::byte>, int) override {}
    void receive(std::span<std::byte>, int) override {}
};

/// Replaces the tensors by their sums over all ranks, with the same bits on each rank. Ranks 2k and
/// 2k + 1 are added, then these sums in pairs, and so on: these are the upper levels of the tree of
/// GradientTree. If the number of ranks is a power of two, each rank sends and receives less than
/// twice the size of the tensors.
void add_up(Ranks& ranks, std::vector<Tensor>& tensors);
/// Returns the texts of all ranks, in the order of the ranks, on every rank.
[[nodiscard]] std::vector<std::string> gather(Ranks& ranks, const std::string& own);
/// Whether `own` is true on any rank.
[[nodiscard]] bool any(Ranks& ranks, bool own);
/// Throws ValueError on every rank if `own` differs between ranks. The message names `what` and the
/// first rank that differs from the leading one.
void require_equal(Ranks& ranks, const std::string& what, const std::string& own);
/// Throws ValueError on every rank unless each rank gets a power of two of the step's
/// micro-batches, so that it computes a whole subtree of the sum. The message names the phase,
/// `where`.
void require_share(const Ranks& ranks, std::int64_t micro_batches, const std::string& where);

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
