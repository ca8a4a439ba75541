#include <algorithm>
#include <catch2/catch.hpp>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include "core/error.h"
#include "core/rng.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/gradient_sums.h"
#include "support/thread_count.h"
#include "train/gradient_sums.h"
#include "train/tiny_training.h"
#include "train/trainer.h"

namespace rank_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

/// Messages between the threads that stand for ranks.
class Mailboxes {
public:
    using Message = std::vector<std::byte>;

    void put(int from, int to, Message message) {
        const std::lock_guard lock(mutex_);
        messages_[{from, to}].push_back(std::move(message));
        arrived_.notify_all();
    }
    [[nodiscard]] Message take(int from, int to) {
        std::unique_lock lock(mutex_);
        std::deque<Message>& box = messages_[{from, to}];
        arrived_.wait(lock, [&] { return !box.empty(); });
        Message message = std::move(box.front());
        box.pop_front();
        return message;
    }

private:
    std::mutex mutex_;
    std::condition_variable arrived_;
    std::map<std::pair<int, int>, std::deque<Message>> messages_;
};

/// A thread of this process as one of several ranks.
class ThreadRank final : public Ranks {
public:
    ThreadRank(Mailboxes& mailboxes, int rank, int size)
        : mailboxes_(mailboxes), rank_(rank), size_(size) {}

    [[nodiscard]] int rank() const override { return rank_; }
    [[nodiscard]] int size() const override { return size_; }
    void send(std::span<const std::byte> bytes, int to) override {
        bytes_sent_ += bytes.size();
        mailboxes_.put(rank_, to, {bytes.begin(), bytes.end()});
    }
    void receive(std::span<std::byte> bytes, int from) override {
        const Mailboxes::Message message = mailboxes_.take(from, rank_);
        if (message.size() != bytes.size()) fail<ValueError>("ranks do not take turns");
        std::ranges::copy(message, bytes.begin());
    }

    [[nodiscard]] std::size_t bytes_sent() const { return bytes_sent_; }

private:
    Mailboxes& mailboxes_;
    int rank_, size_;
    std::size_t bytes_sent_ = 0;
};

/// Results of all ranks, in their order.
template <class Result>
std::vector<Result> on_ranks(int size, const std::function<Result(Ranks&)>& body) {
    Mailboxes mailboxes;
    std::vector<Result> results(static_cast<std::size_t>(size));
    std::vector<std::jthread> threads;
    for (int rank = 0; rank < size; ++rank) {
        threads.emplace_back([&, rank] {
            ThreadRank own(mailboxes, rank, size);
            results[static_cast<std::size_t>(rank)] = body(own);
        });
    }
    threads.clear();
    return results;
}

Tensor gradient_of(std::int64_t micro_batch) {
    return Rng(3).split(static_cast<std::uint64_t>(micro_batch)).normal({50}, 0.0, 1.0);
}

/// The sum of 16 gradients that so many ranks share.
std::vector<std::vector<Tensor>> shared_sums(int size) {
    return on_ranks<std::vector<Tensor>>(size, [](Ranks& ranks) {
        const std::int64_t own = 16 / ranks.size();
        GradientSums tree(own);
        for (std::int64_t i = 0; i < own; ++i) tree.add(i, {gradient_of(ranks.rank() * own + i)});
        std::vector<Tensor> sum = tree.take_sum();
        add_up(ranks, sum);
        return sum;
    });
}

/// The sums of i over all ranks for five parameters of different sizes, which arrive last to first.
std::vector<std::vector<Tensor>> bucket_sums(int size, std::int64_t bucket_bytes) {
    return on_ranks<std::vector<Tensor>>(size, [bucket_bytes](Ranks& ranks) {
        const auto length = [](std::size_t i) { return static_cast<std::int64_t>(1 + i % 3 * 40); };
        std::vector<std::int64_t> bytes;
        for (std::size_t i = 0; i < 5; ++i) bytes.push_back(length(i) * 4);
        GradientExchange exchange(ranks, bytes, bucket_bytes);
        for (std::size_t i = 5; i-- > 0;)
            exchange.add(i, Tensor::full({length(i)}, static_cast<double>(i)));
        return exchange.take_sums();
    });
}

/// Bytes that each of so many ranks sends to add up `numbers` float32 numbers.
std::vector<std::size_t> bytes_sent(int size, std::int64_t numbers) {
    return on_ranks<std::size_t>(size, [numbers](Ranks& ranks) {
        std::vector<Tensor> ones{Tensor::full({numbers}, 1.0)};
        add_up(ranks, ones);
        const std::vector<double> sums = ones.front().to_vector();
        const bool right = std::ranges::all_of(
            sums, [&](double sum) { return sum == static_cast<double>(ranks.size()); });
        return right ? dynamic_cast<ThreadRank&>(ranks).bytes_sent() : 0;
    });
}

const Dataset& faces() {
    static const Dataset dataset = synthetic_dataset(128);
    return dataset;
}

/// Both stages with four micro-batches of one image in every step.
TrainConfig shared_config() {
    TrainConfig config = tiny_two_stage_config();
    config.stage1.batch = 4;
    config.stage1.micro_batch = 1;
    config.stage2.batch = {4, 4};
    config.stage2.micro_batch = {1, 1};
    config.stage2.images = {8, 8};
    config.discriminator.group_size = 1;
    return config;
}

struct Trained {
    std::vector<Tensor> weights;
    std::vector<double> losses;
};

/// What each rank has after all steps.
std::vector<Trained> trained_by(int size) {
    return on_ranks<Trained>(size, [](Ranks& ranks) {
        Trainer trainer(shared_config(), faces(), nullptr, 5, &ranks);
        Trained trained;
        for (std::int64_t step = 0; step < trainer.schedule().steps(); ++step)
            trained.losses.push_back(trainer.step().losses.total);
        for (const Parameter& parameter : trainer.model().parameters().all())
            trained.weights.push_back(parameter.variable().value());
        return trained;
    });
}

}  // namespace

TEST_CASE("A power of two of ranks sends each number less than twice, and all have the sum",
          "[ranks]") {
    for (const std::int64_t numbers : {1, 7, 1000})
        for (const int size : {2, 4, 8})
            for (const std::size_t sent : bytes_sent(size, numbers)) {
                INFO(size << " ranks, " << numbers << " numbers");
                CHECK(sent > 0);
                // Halves of odd parts are rounded up on one side.
                CHECK(sent <= sizeof(float) * static_cast<std::size_t>(2 * numbers + 2 * size));
            }
    for (const std::size_t sent : bytes_sent(3, 1000)) CHECK(sent > 0);
}

TEST_CASE("ranks add up to the same bits whatever their number", "[ranks]") {
    const std::vector<Tensor> alone = shared_sums(1).front();
    for (const int size : {2, 4, 8, 16})
        for (const std::vector<Tensor>& sum : shared_sums(size))
            CHECK(identical(sum.front(), alone.front()));
}

TEST_CASE("gradients that travel in buckets have the same sums", "[ranks]") {
    for (const std::int64_t bucket_bytes : {1, 300, 1 << 20}) {
        for (const int size : {1, 2, 3, 4}) {
            for (const std::vector<Tensor>& sums : bucket_sums(size, bucket_bytes)) {
                INFO(size << " ranks, buckets of " << bucket_bytes << " bytes");
                REQUIRE(sums.size() == 5);
                for (std::size_t i = 0; i < sums.size(); ++i)
                    CHECK(sums[i].to_vector() ==
                          std::vector<double>(1 + i % 3 * 40, static_cast<double>(i) * size));
            }
        }
    }
}

TEST_CASE("an exchange that is given up ends without its other buckets", "[ranks]") {
    const auto problems = on_ranks<std::string>(2, [](Ranks& ranks) {
        return error_message<ValueError>([&] {
            GradientExchange exchange(ranks, {4, 4}, 1);
            exchange.add(1, Tensor::full({1}, 1.0));
            fail<ValueError>("out of memory");
        });
    });
    for (const std::string& problem : problems) CHECK(problem == "out of memory");
}

TEST_CASE("an odd number of ranks adds up to the same on each", "[ranks]") {
    const auto sums = on_ranks<double>(3, [](Ranks& ranks) {
        std::vector<Tensor> own{Tensor::scalar(1 << ranks.rank())};
        add_up(ranks, own);
        return own.front().item();
    });
    CHECK(sums == std::vector<double>{7.0, 7.0, 7.0});
}

TEST_CASE("every rank knows what all of them say", "[ranks]") {
    const auto texts = on_ranks<std::vector<std::string>>(3, [](Ranks& ranks) {
        return gather(ranks, std::string(static_cast<std::size_t>(ranks.rank()), 'x'));
    });
    for (const auto& all : texts) CHECK(all == std::vector<std::string>{"", "x", "xx"});
    CHECK(on_ranks<int>(3, [](Ranks& ranks) { return any(ranks, ranks.rank() == 1) ? 1 : 0; }) ==
          std::vector<int>{1, 1, 1});
}

TEST_CASE("a rank that differs is named on every rank", "[ranks]") {
    const auto messages = on_ranks<std::string>(3, [](Ranks& ranks) {
        return error_message<ValueError>(
            [&] { require_equal(ranks, "a seed", ranks.rank() == 2 ? "7" : "5"); });
    });
    for (const std::string& message : messages)
        CHECK(message.find("rank 2 has a seed that differs") != std::string::npos);
}

TEST_CASE("ranks that cannot share a step evenly are refused", "[ranks]") {
    Mailboxes mailboxes;
    const auto allowed = [&](int size, std::int64_t micro_batches) {
        const ThreadRank ranks(mailboxes, 0, size);
        return error_message<ValueError>([&] { require_share(ranks, micro_batches, "stage 1"); }) ==
               "";
    };
    CHECK(allowed(1, 12));
    CHECK(allowed(4, 8));
    CHECK(allowed(3, 12));
    CHECK_FALSE(allowed(16, 8));
    CHECK_FALSE(allowed(3, 8));
    CHECK_FALSE(allowed(2, 12));
}

TEST_CASE("1, 2 and 4 ranks train both stages to the same bits", "[ranks]") {
    const Trained alone = trained_by(1).front();
    CHECK(alone.losses.size() > 5);
    for (const int size : {2, 4}) {
        for (const Trained& rank : trained_by(size)) {
            CHECK(rank.losses == alone.losses);
            CHECK(all_identical(rank.weights, alone.weights));
        }
    }
}

}  // namespace rank_tests
