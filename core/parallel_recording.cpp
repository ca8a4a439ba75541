#include "core/parallel_recording.h"

#include <algorithm>

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

double WorkProfile::span_seconds() const {
    double sum = serial_seconds();
    for (const RecordedLoop& loop : loops) {
        double longest = 0.0;
        for (const WorkProfile& chunk : loop.chunks)
            longest = std::max(longest, chunk.span_seconds());
        sum += longest;
    }
    return sum;
}

double WorkProfile::seconds_on(int threads, double loop_seconds) const {
    double sum = serial_seconds();
    for (const RecordedLoop& loop : loops) sum += loop.seconds_on(threads, loop_seconds);
    return sum;
}

double RecordedLoop::seconds_on(int threads, double loop_seconds) const {
    const auto most = static_cast<std::size_t>(std::max(threads, 1));
    std::vector<double> busy(std::min(most, chunks.size()), 0.0);
    for (std::size_t i = 0; i < chunks.size(); ++i) {
        // The thread that becomes free first takes the next chunk.
        std::ranges::pop_heap(busy, std::greater());
        const std::size_t helpers = most / chunks.size() + (i < most % chunks.size() ? 1 : 0);
        busy.back() +=
            chunks[i].seconds_on(std::max<int>(1, static_cast<int>(helpers)), loop_seconds);
        std::ranges::push_heap(busy, std::greater());
    }
    return std::ranges::max(busy) + (threads > 1 ? loop_seconds : 0.0);
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

void ParallelRecording::loop(std::int64_t chunks, const char* caller,
                             const std::function<void(std::int64_t)>& body) {
    RecordedLoop loop{.file = caller, .before_seconds = thread_seconds() - mark_, .chunks = {}};
    const struct Return {
        ParallelRecording& recording;
        WorkProfile* outer;
        ~Return() { recording.current_ = outer; }
    } back{*this, current_};
    for (std::int64_t chunk = 0; chunk < chunks; ++chunk) {
        WorkProfile inner;
        current_ = &inner;
        mark_ = thread_seconds();
        body(chunk);
        inner.after_seconds = thread_seconds() - mark_;
        loop.chunks.push_back(std::move(inner));
    }
    back.outer->loops.push_back(std::move(loop));
    mark_ = thread_seconds();
}

}  // namespace stymo
