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
// the same tree (`add_up`), so the result does not depend on how many machines there are.
//
// The price is memory. A sum waits for its partner, one for each level that is incomplete: if
// micro-batches are computed in order, that is at most their logarithm, plus those that are being
// computed (`most_sets`). Each parameter has a tree of its own, so a parameter's sum is exchanged
// as soon as it is complete, while the backward pass goes on.

#include "train/gradient_sums.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <iterator>
#include <utility>

#include "core/clock.h"
#include "core/error.h"
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

template <class T>
std::span<std::byte> bytes_of(std::vector<T>& values) {
    return std::as_writable_bytes(std::span(values));
}

/// From the first rank to all others, along a binomial tree.
void broadcast(Ranks& ranks, std::span<std::byte> bytes) {
    const int rank = ranks.rank(), size = ranks.size();
    const auto all = static_cast<int>(std::bit_ceil(static_cast<unsigned>(size)));
    for (int step = all / 2; step > 0; step /= 2) {
        if (rank % (2 * step) == step) ranks.receive(bytes, rank - step);
        if (rank % (2 * step) == 0 && rank + step < size) ranks.send(bytes, rank + step);
    }
}

/// Recursive halving and doubling (Thakur, Rabenseifner and Gropp 2005), if the number of ranks is
/// a power of two: each rank sums one part of the numbers, then all parts are exchanged. The sums
/// have the same bits as those of `add_up_whole`, since a + b = b + a.
template <class T>
void add_up_in_parts(Ranks& ranks, std::span<T> sums) {
    struct Split {
        std::span<T> kept, given;
        int other;
    };
    std::vector<Split> splits;
    std::vector<T> received;
    for (int step = 1; step < ranks.size(); step *= 2) {
        const std::size_t half = sums.size() / 2;
        Split split{sums.first(half), sums.subspan(half), ranks.rank() ^ step};
        if (ranks.rank() > split.other) std::swap(split.kept, split.given);
        received.resize(split.kept.size());
        ranks.exchange(std::as_bytes(split.given), bytes_of(received), split.other);
        for (std::size_t i = 0; i < received.size(); ++i) split.kept[i] += received[i];
        splits.push_back(split);
        sums = split.kept;
    }
    for (; !splits.empty(); splits.pop_back()) {
        const Split& split = splits.back();
        ranks.exchange(std::as_bytes(split.kept), std::as_writable_bytes(split.given), split.other);
    }
}

/// Sums along a tree, for any number of ranks.
template <class T>
void add_up_whole(Ranks& ranks, std::vector<T>& sums) {
    const int rank = ranks.rank(), size = ranks.size();
    std::vector<T> other;
    // The last of an odd number of partial sums has no partner and moves up unchanged.
    for (int step = 1; step < size && rank % step == 0; step *= 2) {
        if (rank / step % 2 == 1) {
            ranks.send(bytes_of(sums), rank - step);
        } else if (rank + step < size) {
            other.resize(sums.size());
            ranks.receive(bytes_of(other), rank + step);
            for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += other[i];
        }
    }
    broadcast(ranks, bytes_of(sums));
}

std::string rank_name(std::size_t rank) {
    return "rank " + std::to_string(rank);
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

void Ranks::exchange(std::span<const std::byte> sent, std::span<std::byte> received, int other) {
    if (rank() < other) {
        send(sent, other);
        receive(received, other);
    } else {
        receive(received, other);
        send(sent, other);
    }
}

void add_up(Ranks& ranks, std::vector<Tensor>& tensors) {
    if (ranks.size() == 1 || tensors.empty()) return;
    dispatch(tensors.front().dtype(), [&]<class T>(T) {
        std::vector<T> sums;
        for (const Tensor& tensor : tensors) {
            const std::span<const T> values = tensor.values<T>();
            sums.insert(sums.end(), values.begin(), values.end());
        }
        if (std::has_single_bit(static_cast<unsigned>(ranks.size())))
            add_up_in_parts(ranks, std::span(sums));
        else
            add_up_whole(ranks, sums);
        auto next = sums.begin();
        for (Tensor& tensor : tensors) {
            const auto end = next + tensor.size();
            std::copy(next, end, tensor.mutable_values<T>().begin());
            next = end;
        }
    });
}

std::vector<std::string> gather(Ranks& ranks, const std::string& own) {
    const auto count = static_cast<std::size_t>(ranks.size());
    std::vector<std::string> all(count);
    all[static_cast<std::size_t>(ranks.rank())] = own;
    if (count == 1) return all;
    std::vector<std::uint64_t> lengths(count);
    const auto bytes = [](std::string& text) {
        return std::as_writable_bytes(std::span(text.data(), text.size()));
    };
    if (!ranks.leads()) {
        std::vector<std::uint64_t> length{own.size()};
        ranks.send(bytes_of(length), 0);
        std::string text = own;
        ranks.send(bytes(text), 0);
    } else {
        lengths[0] = own.size();
        for (std::size_t rank = 1; rank < count; ++rank) {
            const std::span<std::uint64_t> length = std::span(lengths).subspan(rank, 1);
            ranks.receive(std::as_writable_bytes(length), static_cast<int>(rank));
            all[rank].resize(length.front());
            ranks.receive(bytes(all[rank]), static_cast<int>(rank));
        }
    }
    broadcast(ranks, bytes_of(lengths));
    for (std::size_t rank = 0; rank < count; ++rank) {
        all[rank].resize(lengths[rank]);
        broadcast(ranks, bytes(all[rank]));
    }
    return all;
}

bool any(Ranks& ranks, bool own) {
    return std::ranges::count(gather(ranks, own ? "1" : "0"), "1") > 0;
}

void require_equal(Ranks& ranks, const std::string& what, const std::string& own) {
    const std::vector<std::string> all = gather(ranks, own);
    const auto other =
        std::ranges::find_if(all, [&](const std::string& text) { return text != all.front(); });
    if (other == all.end()) return;
    fail<ValueError>(rank_name(static_cast<std::size_t>(other - all.begin())), " has ", what,
                     " that differs from that of rank 0; start all ranks with the same program, "
                     "configuration and photos");
}

void require_share(const Ranks& ranks, std::int64_t micro_batches, const std::string& where) {
    const std::int64_t size = ranks.size();
    if (size == 1) return;
    if (micro_batches % size == 0 &&
        std::has_single_bit(static_cast<std::uint64_t>(micro_batches / size)))
        return;
    fail<ValueError>(size, " ranks cannot share the ", micro_batches, " micro-batches of a step (",
                     where,
                     "): each needs 1, 2, 4, 8 or another power of two of them; start "
                     "fewer ranks or change batch and micro_batch");
}

GradientExchange::GradientExchange(Ranks& ranks, const std::vector<std::int64_t>& bytes,
                                   std::int64_t bucket_bytes)
    : ranks_(ranks),
      exchanged_before_(ranks.exchange_seconds()),
      sums_(bytes.size()),
      bucket_of_(bytes.size()) {
    std::int64_t filled = bucket_bytes;
    for (std::size_t i = bytes.size(); i-- > 0;) {
        if (filled >= bucket_bytes) {
            buckets_.push_back({i, i + 1, 0});
            filled = 0;
        }
        filled += bytes[i];
        buckets_.back().begin = i;
        ++buckets_.back().missing;
        bucket_of_[i] = buckets_.size() - 1;
    }
    if (ranks.size() > 1) thread_ = std::jthread([this](const std::stop_token& s) { run(s); });
}

void GradientExchange::add(std::size_t i, Tensor sum) {
    const std::lock_guard lock(mutex_);
    sums_[i] = std::move(sum);
    if (--buckets_[bucket_of_[i]].missing == 0) arrived_.notify_all();
}

std::vector<Tensor> GradientExchange::take_sums() {
    if (!thread_.joinable()) return std::move(sums_);
    const double begin = seconds_now();
    thread_.join();
    if (problem_) std::rethrow_exception(problem_);
    const double exchanged = ranks_.exchange_seconds() - exchanged_before_;
    ranks_.add_hidden_seconds(std::max(0.0, exchanged - (seconds_now() - begin)));
    return std::move(sums_);
}

void GradientExchange::run(const std::stop_token& stop) {
    try {
        for (Bucket& bucket : buckets_) {
            std::unique_lock lock(mutex_);
            if (!arrived_.wait(lock, stop, [&] { return bucket.missing == 0; })) return;
            lock.unlock();
            const auto first = sums_.begin() + static_cast<std::ptrdiff_t>(bucket.begin);
            const auto last = sums_.begin() + static_cast<std::ptrdiff_t>(bucket.end);
            std::vector<Tensor> part(std::make_move_iterator(first), std::make_move_iterator(last));
            add_up(ranks_, part);
            std::ranges::move(part, first);
        }
    } catch (...) {
        problem_ = std::current_exception();
    }
}

}  // namespace stymo
