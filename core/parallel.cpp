#include "core/parallel.h"

#include <omp.h>
#include <pthread.h>

#include <algorithm>
#include <atomic>

#include "core/error.h"
#include "core/machine_limits.h"
#include "core/parallel_recording.h"
#include "core/task_team.h"

namespace stymo {

namespace {

/// 0 means one thread for each usable processor.
std::atomic<int> requested_threads{0};

/// Threads that run a loop on a team at present. A process has one set of processors, so they
/// share it.
std::atomic<int> active_callers{0};

class ActiveCaller {
public:
    ActiveCaller() { ++active_callers; }
    ~ActiveCaller() { --active_callers; }
    ActiveCaller(const ActiveCaller&) = delete;
    ActiveCaller& operator=(const ActiveCaller&) = delete;
};

/// A child of fork has none of its parent's threads, but OpenMP would wait for them. So the team of
/// the thread that forks ends before, and both processes make another one when they need it. Loops
/// of other threads do not go on in the child.
void make_fork_safe() {
    [[maybe_unused]] static const int registered = pthread_atfork(
        [] { static_cast<void>(omp_pause_resource(omp_pause_hard, omp_get_initial_device())); },
        nullptr, [] { active_callers = omp_in_parallel(); });
}

int share_of(int threads) {
    return std::max(1, threads / std::max(1, active_callers.load(std::memory_order_relaxed)));
}

template <class Body>
void run_alone(std::int64_t chunks, const Body& body) {
    for (std::int64_t chunk = 0; chunk < chunks; ++chunk) body(chunk, 0);
}

/// Calls body(chunk, thread) for all chunks.
template <class Body>
void run_chunks(std::int64_t chunks, const char* caller, const Body& body) {
    if (chunks <= 1) return run_alone(chunks, body);
    if (ParallelRecording* const recording = ParallelRecording::of_this_thread())
        return recording->loop(chunks, caller, [&](std::int64_t chunk) { body(chunk, 0); });
    if (TaskTeam* const team = TaskTeam::of_this_thread())
        return team->inner_loop(chunks, std::cref(body));
    const int threads = thread_count();
    if (threads == 1 || omp_in_parallel() != 0) return run_alone(chunks, body);
    const ActiveCaller active;
    if (share_of(threads) == 1) return run_alone(chunks, body);
    make_fork_safe();
    FirstError error;
    std::atomic<std::int64_t> next{0};
    // The team always has the same size, because libgomp ends the threads that a smaller team does
    // not use. A thread beyond this caller's share takes no further chunk.
#pragma omp parallel num_threads(threads)
    {
        const int thread = omp_get_thread_num();
        while (thread < share_of(threads)) {
            const std::int64_t chunk = next.fetch_add(1, std::memory_order_relaxed);
            if (chunk >= chunks) break;
            try {
                body(chunk, thread);
            } catch (...) {
                error.keep_current();
            }
        }
    }
    error.rethrow();
}

}  // namespace

void set_thread_count(int count) {
    if (count < 0 || count > most_threads)
        fail<ValueError>("[threads] ", count,
                         " threads; give 0 for one per processor or a number from 1 to ",
                         most_threads);
    requested_threads = count;
}

int thread_count() {
    const int requested = requested_threads;
    return requested > 0 ? requested : usable_processors();
}

void parallel_for(std::int64_t count, std::int64_t grain,
                  const std::function<void(std::int64_t, std::int64_t)>& body, const char* caller) {
    grain = std::max<std::int64_t>(grain, 1);
    run_chunks(chunk_count(count, grain), caller, [&](std::int64_t chunk, int) {
        body(chunk * grain, std::min(count, (chunk + 1) * grain));
    });
}

void parallel_items(std::int64_t count, const std::function<void(std::int64_t, int)>& body,
                    const char* caller) {
    run_chunks(count, caller, body);
}

void parallel_tasks(std::int64_t count, const std::function<void(std::int64_t)>& body,
                    const char* caller) {
    const auto task = [&](std::int64_t i, int) { body(i); };
    const int threads = thread_count();
    if (count <= 1 || threads == 1 || omp_in_parallel() != 0 ||
        ParallelRecording::of_this_thread() != nullptr)
        return run_chunks(count, caller, task);
    const ActiveCaller active;
    // Alone, each task is on all of the caller's threads.
    if (share_of(threads) == 1) return run_alone(count, task);
    make_fork_safe();
    TaskTeam team(threads);
    FirstError error;
    std::atomic<std::int64_t> next{0};
#pragma omp parallel num_threads(threads)
    {
        // OMP_THREAD_LIMIT and OMP_DYNAMIC give fewer.
#pragma omp single
        team.expect(omp_get_num_threads());
        const int thread = omp_get_thread_num();
        const auto in_share = [&] { return thread < share_of(threads); };
        team.run(
            thread,
            [&] {
                if (!in_share()) return false;
                const std::int64_t i = next.fetch_add(1, std::memory_order_relaxed);
                if (i >= count) return false;
                try {
                    body(i);
                } catch (...) {
                    error.keep_current();
                }
                return true;
            },
            in_share);
    }
    error.rethrow();
}

}  // namespace stymo
