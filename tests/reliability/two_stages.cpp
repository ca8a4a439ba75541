#include "reliability/two_stages.h"

#include <catch2/catch.hpp>
#include <stdexcept>

#include "apps/tiny_run.h"
#include "core/clock.h"
#include "core/io/file.h"
#include "reliability/same_run.h"

namespace stymo {

namespace fs = std::filesystem;

namespace {

constexpr const char* configuration = R"({
  "parent": "tiny.json",
  "decoder": {"resolution": 128, "block_channels": [16, 8]},
  "reconstruction": {"resolution_weights": [0.5, 1.0]},
  "stage2": {"resolutions": [64, 128], "images": [8, 8], "fade_images": [0, 4], "batch": [2, 2],
             "micro_batch": [1, 2], "r1_gamma": [0.1, 0.2], "r1_interval": 2,
             "augmentation_target": 0.1, "augmentation_images": 16, "samples_per_ray": 4},
  "discriminator": {"channel_multiplier": 2, "max_channels": 8, "group_size": 2},
  "output": {"checkpoint_steps": 1, "sample_steps": 6, "keep_last": 2, "statistics_images": 4}
})";

TwoStageRun trained() {
    write_file(tiny_run() / "two.json", configuration);
    const double start = seconds_now();
    RunningTool running(tiny_run(), "stymo-train",
                        words(std::string(two_stages).substr(12) + "two"));
    const ToolOutcome outcome = running.wait();
    if (outcome.exit_code != 0) throw std::runtime_error(outcome.err);
    return {tiny_run() / "two", seconds_now() - start};
}

}  // namespace

const TwoStageRun& two_stage_run() {
    static const TwoStageRun run = trained();
    return run;
}

void check_finishes(const fs::path& run) {
    const bool has_begun = fs::exists(run / "latest");
    const ToolOutcome outcome =
        run_tool(tiny_run(), two_stages + run.string() + (has_begun ? " --resume latest" : ""));
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    check_same_run(run, two_stage_run().folder, 12);
}

}  // namespace stymo
