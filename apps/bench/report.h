#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/bench/case.h"
#include "apps/bench/peer.h"
#include "core/io/json_writer.h"
#include "core/kernels/peak.h"

namespace stymo {

/// What one row has come to, in the units of the table.
struct BenchRow {
    std::string name;
    std::string what;
    int threads = 0;
    double median_seconds = 0.0;
    double minimum_seconds = 0.0;
    std::optional<double> share_of_peak{};  ///< of the machine's, with as many threads
    std::optional<double> psnr_mean{};
    std::optional<double> psnr_worst{};
    double peak_memory = 0.0;  ///< MiB
    std::optional<PeerTime> peer{};
    std::string remark{};
};

/// The row as one JSON object, which `row_from_json` reads back, the peer aside.
[[nodiscard]] JsonValue to_json(const BenchRow& row);
/// Throws Error for what is no such object.
[[nodiscard]] BenchRow row_from_json(const std::string& text);

/// Measures a row in this process, then the peak that it is held against.
[[nodiscard]] BenchRow measure_row(const BenchCase& bench_case, const BenchRun& run);

/// A table of text cells; the first row is the heading.
using Cells = std::vector<std::vector<std::string>>;
[[nodiscard]] Cells cells(const std::vector<BenchRow>& rows);
/// In Markdown, columns aligned.
[[nodiscard]] std::string markdown(const Cells& cells);
/// Cells with commas, quotes or line ends in quotes (RFC 4180).
[[nodiscard]] std::string csv(const Cells& cells);
/// All numbers at full precision, times in seconds.
[[nodiscard]] Cells full_cells(const std::vector<BenchRow>& rows);
[[nodiscard]] JsonValue to_json(const kernels::MachinePeak& peak);
[[nodiscard]] std::string text(const kernels::MachinePeak& peak);
/// "12.3", with so many digits behind the point.
[[nodiscard]] std::string decimal(double value, int digits);

}  // namespace stymo
