#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/tensor.h"

namespace stymo {

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

}  // namespace stymo
