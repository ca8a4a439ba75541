// Runs that are killed or asked to stop.
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <random>
#include <thread>

#include "apps/tiny_run.h"
#include "core/clock.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "reliability/two_stages.h"

namespace {

using namespace stymo;
namespace fs = std::filesystem;

/// STYMO_KILLS, or 20.
int kills() {
    const char* const text = std::getenv("STYMO_KILLS");
    return text == nullptr ? 20 : std::atoi(text);
}

std::vector<std::string> arguments_of(const std::string& command) {
    std::vector<std::string> all = words(command);
    all.erase(all.begin());
    return all;
}

}  // namespace

TEST_CASE("a run that is killed at any moment ends with the weights of one that was not",
          "[slow]") {
    const TwoStageRun& whole = two_stage_run();
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> moment(0.0, 1.1 * whole.seconds);
    int ended_before = 0, began_again = 0;
    for (int kill = 0; kill < kills(); ++kill) {
        const ScratchFolder disk;
        const fs::path run = disk / "run";
        const double seconds = moment(random);
        {
            RunningTool running(tiny_run(), "stymo-train", arguments_of(two_stages + run.string()));
            std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
            running.send(SIGKILL);
            ended_before += running.wait().exit_code == 0 ? 1 : 0;
        }
        INFO("killed after " << seconds << " s");
        began_again += fs::exists(run / "latest") ? 0 : 1;
        check_finishes(run);
    }
    std::cout << kills() << " kills within " << 1.1 * whole.seconds << " s: " << ended_before
              << " after the end, " << began_again << " before the first checkpoint\n";
}

TEST_CASE("a run that is asked to stop saves a checkpoint within ten seconds", "[slow]") {
    static_cast<void>(two_stage_run());
    for (const int signal : {SIGTERM, SIGINT}) {
        const ScratchFolder disk;
        const fs::path run = disk / "run";
        RunningTool running(tiny_run(), "stymo-train", arguments_of(two_stages + run.string()));
        REQUIRE(running.says("train "));
        const double start = seconds_now();
        running.send(signal);
        CHECK(running.wait().exit_code == 0);
        const double seconds = seconds_now() - start;
        std::cout << (signal == SIGTERM ? "SIGTERM" : "Ctrl-C") << ": ended after " << seconds
                  << " s\n";
        CHECK(seconds < 10.0);
        CHECK(fs::exists(run / "latest"));
        check_finishes(run);
    }
}
