#include <catch2/catch.hpp>

#include "core/clock.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/parallel_recording.h"
#include "support/thread_count.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// Computes for this time.
void work_for(double seconds) {
    const double end = thread_seconds() + seconds;
    while (thread_seconds() < end) {
    }
}

}  // namespace

TEST_CASE("A profile predicts times as threads take chunks in order", "[parallel]") {
    const WorkProfile profile{{{"a", 1.0, {3.0, 1.0, 1.0, 1.0}}, {"b", 2.0, {2.0, 2.0, 2.0}}}, 0.5};
    CHECK(profile.serial_seconds() == 3.5);
    CHECK(profile.work_seconds() == 15.5);
    CHECK(profile.span_seconds() == 8.5);
    CHECK(profile.seconds_on(1) == profile.work_seconds());
    CHECK(profile.seconds_on(2) == 3.5 + 3.0 + 4.0);
    CHECK(profile.seconds_on(64) == profile.span_seconds());
    CHECK(profile.seconds_on(2, 0.25) == 3.5 + 3.0 + 4.0 + 0.5);
}

TEST_CASE("A recording holds the loops of its thread, in the plan for more threads", "[parallel]") {
    const ThreadCount restored;
    set_thread_count(16);
    const ParallelRecording recording;
    CHECK_THROWS_AS(ParallelRecording(), ValueError);
    constexpr double slice = 1e-3;
    work_for(slice);
    std::vector<std::int64_t> order;
    parallel_for(10, 4, [&](std::int64_t begin, std::int64_t end) {
        order.push_back(begin);
        work_for(slice * static_cast<double>(end - begin));
        // A loop within a chunk belongs to the chunk.
        parallel_for(2, 1, [](std::int64_t, std::int64_t) {});
    });
    parallel_tasks(2, [&](std::int64_t) {
        // Fewer tasks than threads: each of them is on all threads.
        parallel_items(3, [&](std::int64_t, int thread) { CHECK(thread == 0); });
    });
    CHECK(order == std::vector<std::int64_t>{0, 4, 8});
    const WorkProfile profile = recording.profile();
    REQUIRE(profile.loops.size() == 3);
    CHECK(profile.loops[0].file.ends_with("test_parallel_recording.cpp"));
    CHECK(profile.loops[0].before_seconds >= slice);
    REQUIRE(profile.loops[0].chunk_seconds.size() == 3);
    CHECK(profile.loops[0].chunk_seconds[0] >= 4.0 * slice);
    CHECK(profile.loops[0].chunk_seconds[2] >= 2.0 * slice);
    CHECK(profile.loops[2].chunk_seconds.size() == 3);
}
