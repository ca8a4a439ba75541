#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/bench/study.h"
#include "apps/common/command_line.h"
#include "core/matmul_precision.h"

/// The table of speeds.
namespace stymo {

/// The peak performance with which a row is compared.
enum class Limit { none, float32, bfloat16 };
/// That of products of this precision.
[[nodiscard]] Limit limit_of(MatmulPrecision precision);

struct Measurement {
    Timing timing;      ///< of one frame, step, ...
    double work = 0.0;  ///< multiply-adds done in that time; 0: not counted
    Limit limit = Limit::float32;
    std::string remark{};
    /// MiB, of a process that does nothing else. Taken before errors are measured.
    double peak_memory = peak_memory_mebibytes();
    std::optional<ImageError> error{};  ///< against the exact frames
};

/// One row of the table of speeds.
struct SpeedRow {
    std::string name;
    std::string command;  ///< command of stymo-bench that measures it
    std::string what;
    std::function<Measurement(const BenchOptions&)> measure;
    std::string peer{};  ///< name of the peer's measurement; empty: the peer has none
    int threads = 0;     ///< 0: the number of the command line
};

/// `measure` with these arguments after the options.
[[nodiscard]] auto with(auto measure, auto... arguments) {
    return [=](const BenchOptions& options) { return measure(options, arguments...); };
}

/// The rows of a command ("all": of all commands), in the order of the table.
[[nodiscard]] std::vector<SpeedRow> speed_rows(const std::string& command = "all");
// Its parts.
[[nodiscard]] std::vector<SpeedRow> frame_rows();
[[nodiscard]] std::vector<SpeedRow> step_rows();
[[nodiscard]] std::vector<SpeedRow> training_rows();
[[nodiscard]] std::vector<SpeedRow> kernel_rows();

/// The program that does the same work in PyTorch.
struct PeerProgram {
    std::filesystem::path script;  ///< scripts/torch_peer.py; empty: none
    /// Python for which Debian's PyTorch is built.
    std::filesystem::path python = "/usr/bin/python3";
};
/// Why there is no peer: no script, or no PyTorch in that Python. Empty if there is one. Throws
/// FileError for a script that does not exist.
[[nodiscard]] std::string missing_peer(const PeerProgram& program);

/// The study of a command's rows ("all": of all commands). Each row is measured in a separate
/// process, so that its peak memory is known, and the peer directly after it, unless `program` has
/// no script. `decoder` is the configuration that the peer reproduces.
[[nodiscard]] Study speed_study(const std::string& command, const PeerProgram& program,
                                const DecoderConfig& decoder);
/// Measures the row with this name in this process, without the peer. Throws UsageError for an
/// unknown name.
[[nodiscard]] AppResult bench_row(const std::string& name, const BenchOptions& options);
/// Names of all rows with the command of each.
[[nodiscard]] AppResult bench_row_names();

}  // namespace stymo
