// When the viewer's moving frames are made at half their side.
#include <catch2/catch.hpp>

#include "apps/view/frame.h"

using stymo::view::MovingSide;

namespace {

void take(MovingSide& side, int frames, double milliseconds) {
    for (int i = 0; i < frames; ++i) side.take(milliseconds);
}

}  // namespace

TEST_CASE("moving frames are halved where that makes them fast enough", "[view]") {
    MovingSide side(33.0);
    take(side, 50, 30.0);
    CHECK_FALSE(side.is_half());
    side.take(200.0);  // one that was held up
    CHECK_FALSE(side.is_half());
    take(side, 7, 80.0);
    CHECK(side.is_half());
    take(side, 50, 25.0);
    CHECK(side.is_half());
    take(side, 50, 7.0);  // whole ones would take 28 ms at most
    CHECK_FALSE(side.is_half());
}

TEST_CASE("moving frames stay whole where smaller ones are hardly faster", "[view]") {
    MovingSide side(33.0);
    take(side, 8, 40.0);
    CHECK(side.is_half());
    take(side, 20, 36.0);
    CHECK_FALSE(side.is_half());
    take(side, 100, 60.0);
    CHECK_FALSE(side.is_half());
}
