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

/// What a command of stymo-bench does: its rows, each in a process of its own so that its peak
/// memory is its own, beside the peer; then the curve and the growth, where they belong to the
/// command. Files of `out` are called after the command.
[[nodiscard]] AppResult bench_session(const std::string& command, const SessionOptions& options,
                                      const CommonOptions& common);
/// One row in this process, without the peer.
[[nodiscard]] AppResult bench_row(const std::string& name, const BenchOptions& options,
                                  const CommonOptions& common);
/// Names of all rows with the command of each.
[[nodiscard]] AppResult bench_row_names();

}  // namespace stymo
