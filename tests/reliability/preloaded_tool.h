#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "apps/tool_run.h"

namespace stymo {

/// Environment variables and their values.
using Environment = std::vector<std::pair<std::string, std::string>>;

/// Runs a command such as "stymo-fit --out fit" in `folder` as a process of its own, with a library
/// of preload/ ("write_recorder") in front of the C library.
[[nodiscard]] ToolOutcome run_preloaded(const std::string& library, const Environment& environment,
                                        const std::filesystem::path& folder,
                                        const std::string& command);

}  // namespace stymo
