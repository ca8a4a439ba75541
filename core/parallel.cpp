#include "core/parallel.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "core/error.h"

namespace stymo {

namespace {

/// One call of parallel_for. Threads claim chunks until none is left, so a thread that the system keeps from running holds up
/// nobody: the others do its share.
struct Job {
    const std::function<void(std::int64_t, std::int64_t)>* body = nullptr;
    std::int64_t count = 0;
    std::int64_t grain = 1;
    std::int64_t chunks = 0;
    std::atomic<std::int64_t> next{0};
    std::atomic<std::int64_t> finished{0};
    std::mutex error_mutex;
    std::exception_ptr error;

    void begin(const std::function<void(std::int64_t, std::int64_t)>& next_body, std::int64_t next_count,
               std::int64_t next_grain) {
        body = &next_body;
        count = next_count;
        grain = next_grain;
        chunks = chunk_count(count, grain);
        next = 0;
        finished = 0;
        error = nullptr;
    }
    void work() {
        for (std::int64_t chunk = next.fetch_add(1); chunk < chunks; chunk = next.fetch_add(1)) {
            try {
                (*body)(chunk * grain, std::min(count, (chunk + 1) * grain));
            } catch (...) {
                const std::lock_guard lock(error_mutex);
                if (!error) error = std::current_exception();
            }
            finished.fetch_add(1);
        }
    }
};

void pause() {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
}

/// Turns of a waiting loop before a thread goes to sleep: about a millisecond, longer than the gap between two ops.
constexpr int spins_before_sleep = 20000;

thread_local bool inside_parallel_for = false;

class ThreadPool {
public:
    ThreadPool() { resize(0); }
    ~ThreadPool() { stop(); }
    ThreadPool(const ThreadPool&) = delete;
    ThreadPool& operator=(const ThreadPool&) = delete;

    [[nodiscard]] int size() const { return size_; }

    void resize(int count) {
        stop();
        size_ = count > 0 ? count : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    }

    /// A job that no thread holds any more. Each worker holds one at most, so there are never more than there are threads.
    std::shared_ptr<Job> idle_job() {
        for (const std::shared_ptr<Job>& job : jobs_) {
            if (job.use_count() > 1) continue;
            std::atomic_thread_fence(std::memory_order_acquire);
            return job;
        }
        return jobs_.emplace_back(std::make_shared<Job>());
    }

    void run(const std::shared_ptr<Job>& job) {
        start();
        {
            const std::lock_guard lock(mutex_);
            job_ = job;
            ++generation_;
        }
        if (sleeping_.load() > 0) wake_.notify_all();
        inside_parallel_for = true;
        job->work();
        inside_parallel_for = false;
        for (int spins = 0; job->finished.load() < job->chunks; ++spins)
            spins < spins_before_sleep ? pause() : std::this_thread::yield();
        const std::lock_guard lock(mutex_);
        job_.reset();
    }

    /// Only one thread at a time may hand out work; another one that comes meanwhile does its work alone.
    std::mutex owner;

private:
    void start() {
        while (static_cast<int>(workers_.size()) < size_ - 1) workers_.emplace_back([this] { serve(); });
    }

    void stop() {
        {
            const std::lock_guard lock(mutex_);
            stopping_ = true;
            ++generation_;
        }
        wake_.notify_all();
        for (std::thread& worker : workers_) worker.join();
        workers_.clear();
        stopping_ = false;
    }

    void serve() {
        inside_parallel_for = true;
        std::uint64_t seen = 0;
        while (true) {
            const std::shared_ptr<Job> job = next_job(seen);
            if (stopping_.load()) return;
            if (job) job->work();
        }
    }

    /// Waits until the generation is no longer `seen`, first awake, then asleep.
    std::shared_ptr<Job> next_job(std::uint64_t& seen) {
        for (int spins = 0; spins < spins_before_sleep && generation_.load() == seen; ++spins) pause();
        std::unique_lock lock(mutex_);
        ++sleeping_;
        wake_.wait(lock, [&] { return generation_.load() != seen; });
        --sleeping_;
        seen = generation_.load();
        return job_;
    }

    int size_ = 1;
    std::vector<std::thread> workers_;
    std::vector<std::shared_ptr<Job>> jobs_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::shared_ptr<Job> job_;
    std::atomic<std::uint64_t> generation_{0};
    std::atomic<int> sleeping_{0};
    std::atomic<bool> stopping_{false};
};

/// The process has one set of processors, so it has one pool.
ThreadPool& pool() {
    static ThreadPool instance;
    return instance;
}

}  // namespace

void set_thread_count(int count) {
    if (count < 0) fail<ValueError>("[threads] ", count, " threads; give 0 for one per processor or a positive number");
    pool().resize(count);
}

int thread_count() {
    return pool().size();
}

void parallel_for(std::int64_t count, std::int64_t grain, const std::function<void(std::int64_t, std::int64_t)>& body) {
    grain = std::max<std::int64_t>(grain, 1);
    const std::int64_t chunks = chunk_count(count, grain);
    std::unique_lock owner(pool().owner, std::defer_lock);
    if (chunks <= 1 || inside_parallel_for || thread_count() == 1 || !owner.try_lock()) {
        for (std::int64_t chunk = 0; chunk < chunks; ++chunk) body(chunk * grain, std::min(count, (chunk + 1) * grain));
        return;
    }
    const std::shared_ptr<Job> job = pool().idle_job();
    job->begin(body, count, grain);
    pool().run(job);
    if (const std::exception_ptr error = std::exchange(job->error, nullptr)) std::rethrow_exception(error);
}

}  // namespace stymo
