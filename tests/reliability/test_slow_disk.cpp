#include <catch2/catch.hpp>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "apps/tiny_run.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "reliability/preloaded_tool.h"

using namespace stymo;

namespace {

struct SlowRun {
    ToolOutcome outcome;
    double disk_share = 0.0;  ///< of the last steps
    long announced = 0;       ///< files
};

/// A training whose photos each take so long to open.
SlowRun train_with_delay(const std::string& milliseconds) {
    const ScratchFolder disk;
    const TemporaryFile counted;
    SlowRun run;
    run.outcome = run_preloaded("slow_disk",
                                {{"STYMO_SLOW_PATH", "faces/images/"},
                                 {"STYMO_SLOW_MILLISECONDS", milliseconds},
                                 {"STYMO_SLOW_COUNT", counted.path()}},
                                tiny_run(),
                                "stymo-train --config tiny.json --data faces --set stage1.steps=8 "
                                "--set data.cache_megabytes=0 --set output.tick_steps=2 --out " +
                                    (disk / "run").string());
    run.announced = std::atol(read_file(counted.path()).c_str());
    std::istringstream lines(read_file(disk / "run" / "stats.jsonl"));
    for (std::string line; std::getline(lines, line);)
        run.disk_share = nlohmann::json::parse(line).value("disk_share", 0.0);
    return run;
}

}  // namespace

TEST_CASE("a slow disk is said, and photos are announced before they are read", "[slow]") {
    const SlowRun slow = train_with_delay("200");
    INFO(slow.outcome.err);
    REQUIRE(slow.outcome.exit_code == 0);
    CHECK_THAT(slow.outcome.err, Catch::Contains("the disk is slow"));
    CHECK(slow.disk_share > 0.3);
    CHECK(slow.announced >= 8);
    const SlowRun fast = train_with_delay("0");
    REQUIRE(fast.outcome.exit_code == 0);
    CHECK(fast.disk_share < slow.disk_share);
}
