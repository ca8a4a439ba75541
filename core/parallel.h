#pragma once

#include <cstdint>
#include <functional>

// A process may fork between calls: the child has threads of its own for the loops below. It must
// not use what another thread of its parent was working on, nor loops if it was forked inside one.
// If the parent has read or written an .exr file, the child must not: OpenEXR would wait for the
// parent's threads.

namespace stymo {

/// Sets the number of threads that `parallel_for` uses in this process; 0 means one for each
/// processor that the process may use (core/machine_limits.h). Throws ValueError for a negative
/// count or one above `most_threads`. Not while another thread computes: a loop has buffers for
/// the threads that it began with.
void set_thread_count(int count);
inline constexpr int most_threads = 1024;
[[nodiscard]] int thread_count();

/// Number of chunks of `grain` indices (the last may be shorter) that cover [0, count).
[[nodiscard]] constexpr std::int64_t chunk_count(std::int64_t count, std::int64_t grain) {
    return (count + grain - 1) / grain;
}

/// Calls `body(begin, end)` for each chunk of at most `grain` indices of [0, count), on several
/// threads.
///
/// The chunks depend only on `count` and `grain`, never on the number of threads. A reduction that
/// stores one partial result for each chunk and adds them in order therefore gives the same bits
/// for any number of threads. A nested call, from within a body, runs on the calling thread. Calls
/// from several threads at once share the threads: each has its part of them, at least one. The
/// first exception that a body throws is rethrown. `caller`, a file of the sources, names the loop
/// in a recording (core/parallel_recording.h).
void parallel_for(std::int64_t count, std::int64_t grain,
                  const std::function<void(std::int64_t, std::int64_t)>& body,
                  const char* caller = __builtin_FILE());

/// Calls `body(item, thread)` for each item of [0, count), for bodies that need buffers of their
/// own: `thread` is below thread_count(), and differs between bodies of this call that run at the
/// same time. Otherwise like `parallel_for` with a grain of 1.
void parallel_items(std::int64_t count, const std::function<void(std::int64_t, int)>& body,
                    const char* caller = __builtin_FILE());

/// Calls `body(i)` for each i of [0, count), for bodies that call `parallel_for` themselves. Calls
/// run side by side, one on each thread. Threads without a call help with the loops inside the
/// calls of others. Exceptions are those of `parallel_for`.
void parallel_tasks(std::int64_t count, const std::function<void(std::int64_t)>& body,
                    const char* caller = __builtin_FILE());

}  // namespace stymo
