#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "nn/layers/batch_norm.h"

using namespace stymo;

TEST_CASE(
    "batch norm divides by the root of a variance of 0 and its epsilon, and refuses a negative one "
    "by its name") {
    ParameterStore store;
    const BatchNorm flat(store, "flat", 2, {.initial_variance = 0.0});
    for (const double scale : flat.scale().value().to_vector())
        CHECK(scale == Approx(1.0 / std::sqrt(BatchNorm::epsilon)));
    const BatchNorm broken(store, "broken", 2, {.initial_variance = -1e-3});
    CHECK_THROWS_AS(broken.scale(), NumericError);
    CHECK_THROWS_WITH(broken.scale(), Catch::Contains("broken.running_variance"));
}
