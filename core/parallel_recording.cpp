#include "core/parallel_recording.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "core/clock.h"
#include "core/error.h"

namespace stymo {

namespace {

thread_local ParallelRecording* recording = nullptr;

}  // namespace

double WorkProfile::serial_seconds() const {
    double sum = after_seconds;
    for (const RecordedLoop& loop : loops) sum += loop.before_seconds;
    return sum;
}

double WorkProfile::work_seconds() const {
    return seconds_on(1);
}

double WorkProfile::span_seconds() const {
    double sum = serial_seconds();
    for (const RecordedLoop& loop : loops) sum += std::ranges::max(loop.chunk_seconds);
    return sum;
}

double WorkProfile::seconds_on(int threads, double loop_seconds) const {
    double sum = serial_seconds();
    for (const RecordedLoop& loop : loops)
        sum += stymo::seconds_on(loop, threads) + (threads > 1 ? loop_seconds : 0.0);
    return sum;
}

double seconds_on(const RecordedLoop& loop, int threads) {
    std::vector<double> busy(static_cast<std::size_t>(std::max(threads, 1)), 0.0);
    for (const double seconds : loop.chunk_seconds) {
        // The thread that becomes free first takes the next chunk.
        std::ranges::pop_heap(busy, std::greater());
        busy.back() += seconds;
        std::ranges::push_heap(busy, std::greater());
    }
    return std::ranges::max(busy);
}

ParallelRecording::ParallelRecording() {
    if (recording != nullptr) fail<ValueError>("this thread records its parallel loops already");
    recording = this;
    mark_ = thread_seconds();
}

ParallelRecording::~ParallelRecording() {
    recording = nullptr;
}

WorkProfile ParallelRecording::profile() const {
    WorkProfile profile = profile_;
    profile.after_seconds = thread_seconds() - mark_;
    return profile;
}

ParallelRecording* ParallelRecording::of_this_thread() {
    return recording;
}

void ParallelRecording::loop(std::int64_t chunks, const std::source_location& caller,
                             const std::function<void(std::int64_t)>& body) {
    if (inside_loop_) {
        for (std::int64_t chunk = 0; chunk < chunks; ++chunk) body(chunk);
        return;
    }
    inside_loop_ = true;
    const struct Leave {
        bool& inside;
        ~Leave() { inside = false; }
    } leave{inside_loop_};
    double begin = thread_seconds();
    RecordedLoop loop{.file = caller.file_name(), .before_seconds = begin - mark_};
    loop.chunk_seconds.reserve(static_cast<std::size_t>(chunks));
    for (std::int64_t chunk = 0; chunk < chunks; ++chunk) {
        body(chunk);
        const double end = thread_seconds();
        loop.chunk_seconds.push_back(end - begin);
        begin = end;
    }
    profile_.loops.push_back(std::move(loop));
    mark_ = thread_seconds();
}

}  // namespace stymo
