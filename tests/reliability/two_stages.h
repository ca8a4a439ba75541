#pragma once

#include <filesystem>
#include <string>

#include "reliability/preloaded_tool.h"

namespace stymo {

/// A short training through both stages and three phases, with a checkpoint after each of its 12
/// steps: the command without --out, to be run in tiny_run(). Needs two_stage_run().
inline constexpr const char* two_stages = "stymo-train --config two.json --data faces --out ";

/// The run folder of that training when nothing happens to it, and how long it took; made at the
/// first call.
struct TwoStageRun {
    std::filesystem::path folder;
    double seconds = 0.0;
};
[[nodiscard]] const TwoStageRun& two_stage_run();

/// Trains to the end in a run folder that was left in some state, and compares what it holds then
/// with two_stage_run().
void check_finishes(const std::filesystem::path& run);

}  // namespace stymo
