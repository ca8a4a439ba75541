#include "core/parallel.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>

#include "core/error.h"
#include "core/machine_limits.h"

namespace stymo {

namespace {

/// 0 means one thread for each usable processor.
std::atomic<int> requested_threads{0};

/// Held by the thread whose team is running. A process has one set of processors, so another thread
/// that calls `parallel_for` meanwhile runs all of its chunks itself.
std::mutex team_mutex;

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
                  const std::function<void(std::int64_t, std::int64_t)>& body) {
    grain = std::max<std::int64_t>(grain, 1);
    const std::int64_t chunks = chunk_count(count, grain);
    const int threads = thread_count();
    const auto run_chunk = [&](std::int64_t chunk) {
        body(chunk * grain, std::min(count, (chunk + 1) * grain));
    };
    std::unique_lock team(team_mutex, std::defer_lock);
    if (chunks <= 1 || threads == 1 || omp_in_parallel() != 0 || !team.try_lock()) {
        for (std::int64_t chunk = 0; chunk < chunks; ++chunk) run_chunk(chunk);
        return;
    }
    FirstError error;
    // The team always has the same size, because libgomp ends the threads that a smaller team does
    // not use.
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
    for (std::int64_t chunk = 0; chunk < chunks; ++chunk) {
        try {
            run_chunk(chunk);
        } catch (...) {
            error.keep_current();
        }
    }
    error.rethrow();
}

void parallel_tasks(std::int64_t count, const std::function<void(std::int64_t)>& body) {
    const std::int64_t together = count - count % thread_count();
    parallel_for(together, 1, [&](std::int64_t i, std::int64_t) { body(i); });
    for (std::int64_t i = together; i < count; ++i) body(i);
}

}  // namespace stymo
