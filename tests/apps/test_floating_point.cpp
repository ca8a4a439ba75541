#include <catch2/catch.hpp>
#include <cfenv>
#include <limits>
#include <thread>
#include <vector>

#include "core/parallel.h"
#include "core/subnormals.h"

using namespace stymo;

namespace {

/// Half the smallest normal number, computed where the caller runs.
float half_of_smallest() {
    volatile float smallest = std::numeric_limits<float>::min();
    return smallest * 0.5F;
}

}  // namespace

TEST_CASE("Subnormal results become zeros on the thread that asks and on those that it starts",
          "[floating_point]") {
    // Tools that ran in this process before may have set this thread, too.
    std::fenv_t before;
    std::fegetenv(&before);
    std::fesetenv(FE_DFL_ENV);
    std::vector<float> results(64, -1.0F);
    float own = -1.0F, normal = 0.0F;
    std::thread asking([&] {
        flush_subnormals();
        own = half_of_smallest();
        volatile float smallest = std::numeric_limits<float>::min();
        normal = smallest * 1.5F;
        set_thread_count(2);
        parallel_for(64, 1, [&](std::int64_t begin, std::int64_t) {
            results[static_cast<std::size_t>(begin)] = half_of_smallest();
        });
        set_thread_count(0);
    });
    asking.join();
    CHECK(own == 0.0F);
    CHECK(normal > std::numeric_limits<float>::min());
    for (const float result : results) CHECK(result == 0.0F);
    CHECK(half_of_smallest() > 0.0F);
    std::fesetenv(&before);
}
