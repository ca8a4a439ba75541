#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <mutex>
#include <numeric>
#include <set>
#include <thread>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "support/thread_count.h"

using namespace stymo;
using namespace stymo::test;

namespace {

using Chunks = std::set<std::pair<std::int64_t, std::int64_t>>;

Chunks chunks_of(std::int64_t count, std::int64_t grain) {
    std::mutex mutex;
    Chunks chunks;
    parallel_for(count, grain, [&](std::int64_t begin, std::int64_t end) {
        const std::lock_guard lock(mutex);
        CHECK(chunks.emplace(begin, end).second);
    });
    return chunks;
}

}  // namespace

TEST_CASE("The chunks do not depend on the number of threads", "[parallel]") {
    const ThreadCount restored;
    for (const int threads : {1, 2, 3}) {
        set_thread_count(threads);
        CHECK(thread_count() == threads);
        CHECK(chunks_of(10, 4) == Chunks{{0, 4}, {4, 8}, {8, 10}});
        CHECK(chunks_of(3, 100) == Chunks{{0, 3}});
        CHECK(chunks_of(0, 4).empty());
    }
    CHECK(chunk_count(10, 4) == 3);
    CHECK(chunk_count(8, 4) == 2);
    CHECK(chunk_count(0, 4) == 0);
}

TEST_CASE("Every index is visited once", "[parallel]") {
    const ThreadCount restored;
    set_thread_count(2);
    std::vector<int> visits(10007, 0);
    parallel_for(10007, 13, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) ++visits[static_cast<std::size_t>(i)];
    });
    CHECK(visits == std::vector<int>(10007, 1));
}

TEST_CASE("An exception of a body arrives at the caller with its type", "[parallel]") {
    const ThreadCount restored;
    for (const int threads : {1, 2}) {
        set_thread_count(threads);
        const auto failing = [](std::int64_t begin, std::int64_t) {
            if (begin == 6) fail<ValueError>("chunk ", begin);
        };
        CHECK_THROWS_AS(parallel_for(10, 2, failing), ValueError);
        CHECK_THROWS_WITH(parallel_for(10, 2, failing), "chunk 6");
        std::atomic<int> visited{0};
        parallel_for(10, 2, [&](std::int64_t, std::int64_t) { ++visited; });
        CHECK(visited == 5);
    }
}

TEST_CASE("A loop inside a loop runs on its own thread", "[parallel]") {
    const ThreadCount restored;
    set_thread_count(2);
    std::vector<double> totals(8, 0.0);
    parallel_for(8, 1, [&](std::int64_t outer, std::int64_t) {
        parallel_for(100, 10, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i)
                totals[static_cast<std::size_t>(outer)] += static_cast<double>(i);
        });
    });
    CHECK(totals == std::vector<double>(8, 4950.0));
}

TEST_CASE("Tasks run side by side, and threads without one help with their loops", "[parallel]") {
    const ThreadCount restored;
    // Waits until `wanted` callers are here at the same time.
    const auto meet = [](std::atomic<int>& here, int wanted) {
        ++here;
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
        while (here < wanted && std::chrono::steady_clock::now() < end) std::this_thread::yield();
        return here >= wanted;
    };
    std::atomic<int> met{0};
    set_thread_count(2);
    std::atomic<int> tasks{0};
    parallel_tasks(2, [&](std::int64_t) { met += meet(tasks, 2) ? 1 : 0; });
    CHECK(met == 2);
    set_thread_count(4);
    met = 0;
    std::atomic<int> chunks{0};
    parallel_tasks(2, [&](std::int64_t) {
        parallel_for(2, 1, [&](std::int64_t, std::int64_t) { met += meet(chunks, 4) ? 1 : 0; });
    });
    CHECK(met == 4);
}

TEST_CASE("Loops inside tasks do all of their work, however many threads help", "[parallel]") {
    const ThreadCount restored;
    for (const int threads : {1, 2, 3, 16}) {
        set_thread_count(threads);
        std::vector<std::vector<double>> totals(5, std::vector<double>(40, 0.0));
        std::atomic<int> clashes{0};
        parallel_tasks(5, [&](std::int64_t task) {
            for (int repeat = 0; repeat < 50; ++repeat) {
                std::vector<std::atomic<int>> users(16);
                parallel_items(40, [&](std::int64_t item, int thread) {
                    auto& user = users.at(static_cast<std::size_t>(thread));
                    if (++user > 1) ++clashes;
                    parallel_for(4, 1, [&](std::int64_t i, std::int64_t) {
                        totals[static_cast<std::size_t>(task)][static_cast<std::size_t>(item)] +=
                            static_cast<double>(i);
                    });
                    --user;
                });
            }
        });
        CHECK(clashes == 0);
        CHECK(totals == std::vector<std::vector<double>>(5, std::vector<double>(40, 300.0)));
    }
}

TEST_CASE("An exception in a loop of a task arrives at the caller", "[parallel]") {
    const ThreadCount restored;
    for (const int threads : {1, 2, 5}) {
        set_thread_count(threads);
        const auto run = [] {
            parallel_tasks(2, [](std::int64_t task) {
                parallel_for(50, 1, [&](std::int64_t begin, std::int64_t) {
                    if (task == 1 && begin == 33) fail<ValueError>("chunk ", begin);
                });
            });
        };
        CHECK_THROWS_WITH(run(), "chunk 33");
    }
}

TEST_CASE(
    "A negative number of threads or far too many are refused, zero is one for each processor",
    "[parallel]") {
    const ThreadCount restored;
    for (const int count : {-1, most_threads + 1})
        CHECK_THROWS_AS(set_thread_count(count), ValueError);
    set_thread_count(0);
    CHECK(thread_count() >= 1);
}

TEST_CASE("Calls from several threads at once each do all of their work", "[parallel]") {
    const ThreadCount restored;
    set_thread_count(2);
    std::vector<std::vector<int>> visits(4, std::vector<int>(1000, 0));
    std::vector<std::thread> callers;
    for (std::vector<int>& own : visits) {
        callers.emplace_back([&own] {
            for (int repeat = 0; repeat < 50; ++repeat) {
                parallel_for(1000, 7, [&own](std::int64_t begin, std::int64_t end) {
                    for (std::int64_t i = begin; i < end; ++i) ++own[static_cast<std::size_t>(i)];
                });
            }
        });
    }
    for (std::thread& caller : callers) caller.join();
    for (const std::vector<int>& own : visits) CHECK(own == std::vector<int>(1000, 50));
}

TEST_CASE("The number of threads may change between calls", "[parallel]") {
    const ThreadCount restored;
    for (int repeat = 0; repeat < 20; ++repeat) {
        set_thread_count(1 + repeat % 3);
        std::atomic<std::int64_t> total{0};
        for (int call = 0; call < 20; ++call)
            parallel_for(100, 3,
                         [&](std::int64_t begin, std::int64_t end) { total += end - begin; });
        CHECK(total == 2000);
    }
}

TEST_CASE("Callers at the same time share the threads", "[parallel]") {
    const ThreadCount restored;
    set_thread_count(4);
    constexpr auto patience = std::chrono::seconds(20);
    std::atomic<bool> second_runs{false}, first_done{false};
    const auto wait_for = [&](const std::atomic<bool>& flag) {
        const auto end = std::chrono::steady_clock::now() + patience;
        while (!flag && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    };
    std::mutex mutex;
    std::set<std::thread::id> threads;
    std::thread second;
    parallel_for(40, 1, [&](std::int64_t chunk, std::int64_t) {
        if (chunk == 0)
            second = std::thread([&] {
                parallel_for(2, 1, [&](std::int64_t, std::int64_t) {
                    second_runs = true;
                    wait_for(first_done);
                });
            });
        // Chunks 0 to 3 may have begun before the other caller.
        wait_for(second_runs);
        if (chunk < 4) return;
        const std::lock_guard lock(mutex);
        threads.insert(std::this_thread::get_id());
        if (chunk == 39) first_done = true;
    });
    second.join();
    CHECK(second_runs);
    CHECK(first_done);
    CHECK(threads.size() <= 2);
}

TEST_CASE("Items know a thread of their own", "[parallel]") {
    const ThreadCount restored;
    set_thread_count(3);
    std::vector<std::atomic<int>> users(3);
    std::atomic<int> items{0}, clashes{0};
    parallel_items(200, [&](std::int64_t, int thread) {
        auto& user = users.at(static_cast<std::size_t>(thread));
        if (++user > 1) ++clashes;
        ++items;
        --user;
    });
    CHECK(items == 200);
    CHECK(clashes == 0);
}

TEST_CASE("A child of fork computes with threads of its own, as does its parent", "[parallel]") {
    const ThreadCount restored;
    set_thread_count(4);
    const auto sum = [] {
        std::atomic<std::int64_t> total{0};
        parallel_for(1000, 1, [&](std::int64_t begin, std::int64_t) { total += begin; });
        parallel_tasks(8, [&](std::int64_t task) {
            parallel_for(100, 1, [&](std::int64_t begin, std::int64_t) { total += task * begin; });
        });
        return total.load();
    };
    const std::int64_t expected = 499500 + 28 * 4950;
    CHECK(sum() == expected);
    // A thread with a team of its own does not fork; its team is missing in the child.
    std::thread([&] { CHECK(sum() == expected); }).join();
    for (int child = 0; child < 3; ++child) {
        const pid_t process = ::fork();
        REQUIRE(process >= 0);
        if (process == 0) {
            ::alarm(60);  // instead of a wait for threads that are not there
            ::_exit(sum() == expected ? 0 : 1);
        }
        int status = -1;
        REQUIRE(::waitpid(process, &status, 0) == process);
        CHECK(status == 0);
        CHECK(sum() == expected);
    }
}
