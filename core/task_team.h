#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <vector>

namespace stymo {

/// The first exception of several threads.
class FirstError {
public:
    void keep_current();
    void rethrow() const;

private:
    std::mutex mutex_;
    std::exception_ptr error_;
};

/// The threads that run the tasks of one call of `parallel_tasks`. A thread without a task helps
/// with the loops that the tasks of other threads contain. For core/parallel.cpp only.
class TaskTeam {
public:
    explicit TaskTeam(int threads) : slots_(static_cast<std::size_t>(threads)), busy_(threads) {}

    /// Says, before any thread calls `run`, that fewer threads came than were wanted.
    void expect(int threads) { busy_ = threads; }

    /// The team in whose task the calling thread is; null outside.
    [[nodiscard]] static TaskTeam* of_this_thread();

    /// Runs tasks on the calling thread, which is number `thread` of the team, as long as `task`
    /// returns true, and then helps as long as `may_help` returns true and others have tasks. Each
    /// thread of the team must call it once.
    void run(int thread, const std::function<bool()>& task, const std::function<bool()>& may_help);

    /// Runs a loop inside the calling thread's task: body(chunk, thread) for all chunks, with help.
    /// A loop inside a chunk of such a loop gets no help. The first exception is rethrown.
    void inner_loop(std::int64_t chunks, const std::function<void(std::int64_t, int)>& body);

private:
    struct InnerLoop {
        std::int64_t chunks = 0;
        const std::function<void(std::int64_t, int)>* body = nullptr;
        std::atomic<std::int64_t> next{0};
        FirstError error;
        void take_chunks(int thread);
    };
    /// Where a thread offers its loop.
    struct alignas(64) Slot {
        std::mutex mutex;
        InnerLoop* loop = nullptr;    ///< guarded by `mutex`
        std::atomic<int> helpers{0};  ///< only grows under `mutex`
    };

    bool help_once(int thread);
    /// Wakes the threads that wait for a change.
    void announce_change();

    std::vector<Slot> slots_;
    std::atomic<int> busy_;  ///< threads that may still have a task
    std::atomic<int> waiting_{0};
    std::atomic<std::uint32_t> changes_{0};
};

}  // namespace stymo
