#include "train/gradient_exchange.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/clock.h"

namespace stymo {

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
