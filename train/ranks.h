#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/tensor.h"

namespace stymo {

/// One of the processes (MPI's ranks) that train one model together. Each computes its share of
/// every batch's gradients and then makes the same update, so all of them have the same weights at
/// any time. The first one alone writes. All ranks make the calls below in the same order, one at a
/// time, from whatever thread.
class Ranks {
public:
    virtual ~Ranks() = default;

    [[nodiscard]] virtual int rank() const = 0;
    [[nodiscard]] virtual int size() const = 0;
    /// Returns once `bytes` may change.
    virtual void send(std::span<const std::byte> bytes, int to) = 0;
    /// As many bytes as the other rank sends.
    virtual void receive(std::span<std::byte> bytes, int from) = 0;
    /// Both at once; the other rank makes the same call.
    virtual void exchange(std::span<const std::byte> sent, std::span<std::byte> received,
                          int other);
    /// Seconds spent in these calls so far, waiting for the other rank included.
    [[nodiscard]] virtual double exchange_seconds() const { return 0.0; }
    /// Those of them in which this rank went on computing.
    [[nodiscard]] double hidden_seconds() const { return hidden_seconds_; }
    void add_hidden_seconds(double seconds) { hidden_seconds_ += seconds; }

    [[nodiscard]] bool leads() const { return rank() == 0; }

private:
    double hidden_seconds_ = 0.0;
};

/// The only process of its training.
class OneRank final : public Ranks {
public:
    [[nodiscard]] int rank() const override { return 0; }
    [[nodiscard]] int size() const override { return 1; }
    void send(std::span<const std::byte>, int) override {}
    void receive(std::span<std::byte>, int) override {}
};

/// Replaces the tensors by their sums over all ranks, the same bits on each. Ranks 2k and 2k + 1
/// are added, then these sums in pairs, and so on: the upper levels of the tree of GradientTree.
/// Where the ranks are a power of two, each sends and receives every number less than twice.
void add_up(Ranks& ranks, std::vector<Tensor>& tensors);
/// The texts of all ranks, in their order, on each.
[[nodiscard]] std::vector<std::string> gather(Ranks& ranks, const std::string& own);
/// Whether it is true on any rank.
[[nodiscard]] bool any(Ranks& ranks, bool own);
/// Throws ValueError on every rank if `own` differs between them, naming `what` and the first rank
/// that differs from the leading one.
void require_equal(Ranks& ranks, const std::string& what, const std::string& own);
/// Throws ValueError on every rank unless the micro-batches of a step are a power of two for each
/// rank: then each has a whole subtree of the sum. `where` names the phase.
void require_share(const Ranks& ranks, std::int64_t micro_batches, const std::string& where);

}  // namespace stymo
