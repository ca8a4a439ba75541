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

/// Chunks of these durations, without loops inside.
RecordedLoop loop_of(double before, const std::vector<double>& seconds) {
    RecordedLoop loop{.before_seconds = before, .chunks = {}};
    for (const double one : seconds) loop.chunks.push_back({{}, one});
    return loop;
}

TEST_CASE("A profile predicts times as threads take chunks in order", "[parallel]") {
    const WorkProfile profile{{loop_of(1.0, {3.0, 1.0, 1.0, 1.0}), loop_of(2.0, {2.0, 2.0, 2.0})},
                              0.5};
    CHECK(profile.serial_seconds() == 3.5);
    CHECK(profile.work_seconds() == 15.5);
    CHECK(profile.span_seconds() == 8.5);
    CHECK(profile.seconds_on(2) == 3.5 + 3.0 + 4.0);
    CHECK(profile.seconds_on(64) == profile.span_seconds());
    CHECK(profile.seconds_on(2, 0.25) == 3.5 + 3.0 + 4.0 + 0.5);
}

TEST_CASE("Threads beyond the chunks share the loops inside them", "[parallel]") {
    const WorkProfile task{{loop_of(1.0, {1.0, 1.0, 1.0, 1.0})}, 0.0};
    const WorkProfile profile{{RecordedLoop{.chunks = {task, task}}}, 0.0};
    CHECK(profile.work_seconds() == 10.0);
    CHECK(profile.seconds_on(2) == 5.0);
    CHECK(profile.seconds_on(4) == 3.0);
    CHECK(profile.seconds_on(5) == 3.0);
    CHECK(profile.seconds_on(8) == 2.0);
    CHECK(profile.span_seconds() == 2.0);
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
        parallel_for(2, 1, [](std::int64_t, std::int64_t) {});
    });
    parallel_tasks(2, [&](std::int64_t) {
        parallel_items(3, [&](std::int64_t, int thread) { CHECK(thread == 0); });
    });
    CHECK(order == std::vector<std::int64_t>{0, 4, 8});
    const WorkProfile profile = recording.profile();
    REQUIRE(profile.loops.size() == 2);
    const RecordedLoop& first = profile.loops[0];
    CHECK(std::string(first.file).ends_with("test_parallel_recording.cpp"));
    CHECK(first.before_seconds >= slice);
    REQUIRE(first.chunks.size() == 3);
    CHECK(first.chunks[0].work_seconds() >= 4.0 * slice);
    CHECK(first.chunks[2].work_seconds() >= 2.0 * slice);
    REQUIRE(first.chunks[2].loops.size() == 1);
    CHECK(first.chunks[2].loops[0].chunks.size() == 2);
    REQUIRE(profile.loops[1].chunks.size() == 2);
    CHECK(profile.loops[1].chunks[1].loops.size() == 1);
}
