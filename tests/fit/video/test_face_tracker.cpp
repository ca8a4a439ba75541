#include <catch2/catch.hpp>
#include <iostream>

#include "fit/video/acted_frame.h"
#include "fit/video/face_tracker.h"

namespace video_tests {

using namespace stymo;

namespace {

/// Mean distance of all points but the jaw's, in distances of the eyes.
double distance(const Landmarks& found, const Landmarks& truth) {
    double sum = 0.0;
    for (std::size_t i = 17; i < truth.size(); ++i) sum += (found[i] - truth[i]).norm();
    return sum / 51.0 / inter_ocular_distance(truth);
}

bool can_detect() {
    if (!FaceDetector::available()) std::cout << "skipped: built without dlib\n";
    return FaceDetector::available();
}

}  // namespace

TEST_CASE("A head that turns, speaks and blinks is followed, also when an arm passes") {
    if (!can_detect()) return;
    const FaceDetector detector;
    FaceTracker tracker(detector, 25.0);
    bool there = false;
    for (int i = 0; i < 32; ++i) {
        INFO("frame " << i);
        Tensor frame = empty_frame(0.35);
        const Landmarks truth = draw_scene(frame, i);
        const std::optional<TrackedFace> face = tracker.next(frame);
        if (!is_covered(i)) {
            REQUIRE(face);
            CHECK(distance(face->found, truth) < 0.15);
            CHECK(distance(face->smooth, truth) < 0.2);
        }
        if (face) CHECK(face->starts == !there);
        there = face.has_value();
    }
    CHECK(tracker.cuts() == 0);
}

TEST_CASE("A face is followed beside another one, which does not replace it while it is gone") {
    if (!can_detect()) return;
    const FaceDetector detector;
    FaceTracker tracker(detector, 10.0);
    for (int i = 0; i < 18; ++i) {
        INFO("frame " << i);
        // In the last frames, after a cut, the other one is alone.
        const bool cut = i >= 16, own = !cut && (i < 4 || i >= 12), other = i >= 2;
        Tensor frame = empty_frame(cut ? 0.8 : 0.35);
        Landmarks truth, others;
        if (own) truth = draw(frame, 1, {.left = 30});
        if (other) others = draw(frame, 3, {.left = 360});
        const std::optional<TrackedFace> face = tracker.next(frame);
        REQUIRE(face.has_value() == (own || cut));
        if (!face) continue;
        CHECK(distance(face->found, own ? truth : others) < 0.15);
        CHECK(face->starts == (i == 0 || i == 12 || i == 16));
    }
    CHECK(tracker.cuts() == 1);
}

}  // namespace video_tests
