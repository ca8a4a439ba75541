#include <algorithm>
#include <catch2/catch.hpp>
#include <sstream>

#include "core/interrupt.h"
#include "core/progress.h"

namespace {

struct Display {
    std::ostringstream stream;
    double now = 100.0;

    stymo::ProgressOutput output(bool terminal, int width = 200) {
        stymo::ProgressOutput result;
        result.stream = &stream;
        result.terminal = terminal;
        result.width = width;
        result.interval = 5.0;
        result.seconds = [this] { return now; };
        return result;
    }
};

}  // namespace

TEST_CASE("Durations read like a clock") {
    CHECK(stymo::duration_text(6.2) == "00:07");
    CHECK(stymo::duration_text(754.0) == "12:34");
    CHECK(stymo::duration_text(3723.0) == "1:02:03");
    CHECK(stymo::duration_text(-1.0) == "00:00");
}

TEST_CASE("Without a terminal progress is a plain line every few seconds") {
    Display display;
    stymo::Progress progress({.title = "train", .total = 100, .unit = "images"},
                             display.output(false));
    for (int done = 1; done <= 12; ++done) {
        display.now += 1.0;
        progress.update(done, "loss 0.5");
    }
    progress.finish("loss 0.4");
    CHECK(display.stream.str() ==
          "train   1% 1/100 1.0 images/s 01:39 left  loss 0.5\n"
          "train   6% 6/100 1.0 images/s 01:34 left  loss 0.5\n"
          "train  11% 11/100 1.0 images/s 01:29 left  loss 0.5\n"
          "train  12% 12/100 1.0 images/s 01:28 left  loss 0.4\n");
}

TEST_CASE("Without a terminal the end is not said twice") {
    const auto lines = [](const std::string& update, const std::string& finish) {
        Display display;
        stymo::Progress progress({.title = "fit", .total = 4}, display.output(false));
        display.now += 1.0;
        progress.update(4, update);
        display.now += 1.0;
        progress.finish(finish);
        const std::string shown = display.stream.str();
        return std::count(shown.begin(), shown.end(), '\n');
    };
    CHECK(lines("loss 0.5", "") == 1);
    CHECK(lines("loss 0.5", "loss 0.5") == 1);
    CHECK(lines("loss 0.5", "loss 0.4") == 2);
    Display display;
    stymo::Progress progress({.title = "fit", .total = 4}, display.output(false));
    progress.finish();
    CHECK_FALSE(display.stream.str().empty());
}

TEST_CASE("Speed and time left of a resumed run count only what this run did") {
    Display display;
    stymo::Progress progress({.title = "train", .total = 100, .first = 80, .unit = "images"},
                             display.output(false));
    display.now += 5.0;
    progress.update(90);
    CHECK(display.stream.str() == "train  90% 90/100 2.0 images/s 00:05 left\n");
}

TEST_CASE("A time limit bounds the time left") {
    Display display;
    stymo::Progress progress({.title = "train", .total = 1000, .time_limit = 20.0},
                             display.output(false));
    display.now += 5.0;
    progress.update(10);
    CHECK(display.stream.str() == "train  25% 10/1000 00:15 left\n");
}

TEST_CASE("On a terminal one line is redrawn in place and never wider than the terminal") {
    Display display;
    {
        stymo::Progress progress({.title = "fit", .total = 4}, display.output(true, 40));
        display.now += 1.0;
        progress.update(1, "a text that is far too long for the line");
        progress.message("photo.png skipped");
    }
    CHECK(display.stream.str() ==
          "\r\x1b[Kfit [######..................]  25% 1/4\r\x1b[Kphoto.png skipped\n");
}

TEST_CASE("A signal within a guard is noted and does not end the process") {
    {
        const stymo::InterruptGuard guard;
        CHECK_FALSE(stymo::interrupted());
        std::raise(SIGTERM);
        CHECK(stymo::interrupted());
    }
    const stymo::InterruptGuard guard;
    CHECK_FALSE(stymo::interrupted());
    std::raise(SIGTERM);
    {
        const stymo::InterruptGuard inner;
        CHECK(stymo::interrupted());
    }
    CHECK(stymo::interrupted());
}
