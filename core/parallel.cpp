#include "core/parallel.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>

#include "core/error.h"
#include "core/machine_limits.h"
#include "core/parallel_recording.h"

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

/// The first exception of several threads.
class FirstError {
public:
    void keep_current() {
        const std::lock_guard lock(mutex_);
        if (!error_) error_ = std::current_exception();
    }
    void rethrow() const {
        if (error_) std::rethrow_exception(error_);
    }

private:
    std::mutex mutex_;
    std::exception_ptr error_;
};

int share_of(int threads) {
    return std::max(1, threads / std::max(1, active_callers.load(std::memory_order_relaxed)));
}

/// Calls body(chunk, thread) for all chunks.
template <class Body>
void run_chunks(std::int64_t chunks, const std::source_location& caller, const Body& body) {
    const auto run_alone = [&] {
        for (std::int64_t chunk = 0; chunk < chunks; ++chunk) body(chunk, 0);
    };
    if (chunks <= 1 || omp_in_parallel() != 0) return run_alone();
    if (ParallelRecording* const recording = ParallelRecording::of_this_thread())
        return recording->loop(chunks, caller, [&](std::int64_t chunk) { body(chunk, 0); });
    const int threads = thread_count();
    if (threads == 1) return run_alone();
    const ActiveCaller active;
    if (share_of(threads) == 1) return run_alone();
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
    if (count < 0)
        fail<ValueError>("[threads] ", count,
                         " threads; give 0 for one per processor or a positive number");
    requested_threads = count;
}

int thread_count() {
    const int requested = requested_threads;
    return requested > 0 ? requested : usable_processors();
}

void parallel_for(std::int64_t count, std::int64_t grain,
                  const std::function<void(std::int64_t, std::int64_t)>& body,
                  const std::source_location& caller) {
    grain = std::max<std::int64_t>(grain, 1);
    run_chunks(chunk_count(count, grain), caller, [&](std::int64_t chunk, int) {
        body(chunk * grain, std::min(count, (chunk + 1) * grain));
    });
}

void parallel_items(std::int64_t count, const std::function<void(std::int64_t, int)>& body,
                    const std::source_location& caller) {
    run_chunks(count, caller, body);
}

void parallel_tasks(std::int64_t count, const std::function<void(std::int64_t)>& body,
                    const std::source_location& caller) {
    const std::int64_t together = count - count % thread_count();
    parallel_for(
        together, 1, [&](std::int64_t i, std::int64_t) { body(i); }, caller);
    for (std::int64_t i = together; i < count; ++i) body(i);
}

}  // namespace stymo
