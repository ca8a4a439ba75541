#pragma once

#include <filesystem>
#include <string>

#include "apps/bench/peer.h"
#include "apps/bench/subject.h"
#include "apps/common/command_line.h"

namespace stymo {

struct SessionOptions {
    BenchOptions bench;
    PeerProgram peer;
    std::filesystem::path out;  ///< empty: nothing is written
};

/// Runs a command of stymo-bench. It measures the command's rows and the peer, each row in a
/// separate process, so that its peak memory is known. Then follow the curve and growth studies, if
/// they belong to the command. Files in `out` are named after the command.
[[nodiscard]] AppResult bench_session(const std::string& command, const SessionOptions& options,
                                      const CommonOptions& common);
/// Measures one row in this process, without the peer.
[[nodiscard]] AppResult bench_row(const std::string& name, const BenchOptions& options,
                                  const CommonOptions& common);
/// Names of all rows with the command of each.
[[nodiscard]] AppResult bench_row_names();

}  // namespace stymo
