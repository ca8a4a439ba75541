#include <catch2/catch.hpp>

#include "core/error.h"
#include "core/median.h"

using namespace stymo;

TEST_CASE("a median is the middle value, or the mean of the two middle ones") {
    CHECK(median({3.0, 1.0, 2.0}) == 2.0);
    CHECK(median({4.0, 1.0, 3.0, 2.0}) == 2.5);
    CHECK(median({7.0}) == 7.0);
    CHECK_THROWS_AS(median({}), ValueError);
}
