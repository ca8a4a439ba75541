#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace stymo {

struct RecordedLoop;

/// How work is divided: what runs on one thread, and the loops whose chunks may run on several.
struct WorkProfile {
    std::vector<RecordedLoop> loops;
    double after_seconds = 0.0;  ///< serial work after the last loop

    [[nodiscard]] double serial_seconds() const;
    /// Time on one thread.
    [[nodiscard]] double work_seconds() const { return seconds_on(1); }
    /// Length of the critical path.
    [[nodiscard]] double span_seconds() const;
    /// Time on so many processors. Threads take the chunks of a loop in order as they become free;
    /// if there are more threads than chunks, they share the loops inside the chunks.
    /// `loop_seconds` is what it costs to begin and to join a loop on several threads. Neither
    /// shared caches nor memory nor clock rates are modelled.
    [[nodiscard]] double seconds_on(int threads, double loop_seconds = 0.0) const;
};

/// A parallel loop that was recorded.
struct RecordedLoop {
    const char* file = "";            ///< whose code called parallel_for
    double before_seconds = 0.0;      ///< serial work between the loop before and this one
    std::vector<WorkProfile> chunks;  ///< at least one

    [[nodiscard]] double seconds_on(int threads, double loop_seconds = 0.0) const;
};

/// While it exists, the parallel loops that this thread starts run on this thread alone, chunk by
/// chunk, and are recorded in processor time. `thread_count()` is still the number of threads for
/// which the job plans its work, so set it to the number that is to be predicted. Loops inside
/// chunks are part of the chunk.
class ParallelRecording {
public:
    /// Throws ValueError if this thread records already.
    ParallelRecording();
    ~ParallelRecording();
    ParallelRecording(const ParallelRecording&) = delete;
    ParallelRecording& operator=(const ParallelRecording&) = delete;

    /// What was recorded until now.
    [[nodiscard]] WorkProfile profile() const;

    /// Null if the calling thread records nothing.
    [[nodiscard]] static ParallelRecording* of_this_thread();
    /// Calls body(chunk) for all chunks.
    void loop(std::int64_t chunks, const char* caller,
              const std::function<void(std::int64_t)>& body);

private:
    WorkProfile profile_;
    WorkProfile* current_ = &profile_;  ///< of the innermost chunk
    double mark_ = 0.0;                 ///< end of the last loop in it
};

}  // namespace stymo
