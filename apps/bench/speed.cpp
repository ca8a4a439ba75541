#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <regex>

#include "apps/bench/peak.h"
#include "apps/bench/study.h"
#include "apps/common/child_process.h"
#include "core/error.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"

namespace stymo {

namespace {

std::vector<Column> columns() {
    std::vector<Column> all{"name", "what", "threads", "median_seconds", "~minimum_seconds"};
    for (const char* more : {"per_second", "share_of_peak", "psnr_mean_db", "psnr_worst_db",
                             "~equal_images", "peak_memory_mebibytes", "remark",
                             "peer_median_seconds", "times_peer", "~peer_peak_memory_mebibytes"})
        all.emplace_back(more);
    return all;
}

Value share_of_peak(const Measurement& one) {
    if (one.limit == Limit::none || one.work <= 0.0) return {};
    double flops = median(one.timing.multiply_adds);
    if (one.limit == Limit::bfloat16) {
        const kernels::MachinePeak peak = kernels::measure_machine_peak();
        flops *= peak.bfloat16_multiply_adds / peak.multiply_adds;
    }
    return flops > 0.0 ? Value(2.0 * one.work / one.timing.median() / flops) : Value();
}

/// A row measured in this process; the peer's cells are empty.
Row measured_here(const SpeedRow& row, const BenchOptions& options) {
    const Measurement one = row.measure(options);
    const double seconds = one.timing.median();
    const auto error = [&](double ImageError::*part) {
        return one.error ? Value((*one.error).*part) : Value();
    };
    Row cells{row.name, row.what, static_cast<std::int64_t>(thread_count()), seconds,
              std::ranges::min(one.timing.seconds)};
    cells.insert(cells.end(), {1.0 / seconds, share_of_peak(one), error(&ImageError::psnr_mean)});
    cells.insert(cells.end(),
                 {error(&ImageError::psnr_worst), one.error && std::isinf(one.error->psnr_worst),
                  one.peak_memory, one.remark, Value(), Value(), Value()});
    return cells;
}

std::string last_line(std::string text) {
    text.erase(text.find_last_not_of('\n') + 1);
    return text.substr(text.find_last_of('\n') + 1);
}

/// The words of a command line that measures a row as this process would.
std::vector<std::string> child_words(const SpeedRow& row, int threads,
                                     const BenchOptions& options) {
    std::vector<std::string> words{own_program(), "row", row.name, "--json"};
    for (const auto& [option, value] :
         {std::pair{"--seed", std::to_string(options.seed)},
          {"--threads", std::to_string(threads)},
          {"--matmul-precision", std::string(name_of(matmul_precision()))},
          {"--repeats", std::to_string(options.repeats)},
          {"--faces", std::to_string(options.faces)},
          {"--views", std::to_string(options.views)},
          {"--samples", std::to_string(options.samples)},
          {"--model", options.model.string()},
          {"--data", options.data.string()}})
        if (!value.empty()) words.insert(words.end(), {option, value});
    return words;
}

/// Measures the same in PyTorch. Throws Error if the script fails.
ChildOutcome run_peer(const PeerProgram& program, const std::string& what,
                      const DecoderConfig& decoder, int threads, const BenchOptions& options) {
    constexpr std::int64_t discriminator_side = 256;
    const bool discriminator = what == "disc" || what == "r1";
    const std::int64_t side =
        discriminator ? std::min(discriminator_side, decoder.resolution) : decoder.resolution;
    // Fewer repetitions for slow measurements.
    const int repeats = what == "r1" ? 1 : std::min(options.repeats, 3);
    // The BLAS of Debian's PyTorch chooses slow kernels on newer processors by itself.
    return run_child({program.python.string(), program.script.string(), "--threads",
                      std::to_string(threads), "--width", std::to_string(decoder.field_width),
                      "--layers", std::to_string(decoder.field_layers), "--samples",
                      std::to_string(options.samples), "--res", std::to_string(side), "--batch",
                      discriminator ? "4" : "1", "-n", std::to_string(repeats), what},
                     {"OPENBLAS_CORETYPE=SkylakeX"});
}

/// Measures a row in a separate process, and the peer after it.
Row measured_apart(const SpeedRow& row, const PeerProgram& program, const DecoderConfig& decoder,
                   const BenchOptions& options) {
    const int threads = row.threads > 0 ? row.threads : thread_count();
    const ChildOutcome own = run_child(child_words(row, threads, options));
    if (own.exit_code != 0) {
        const std::string reason = last_line(own.err), prefix = "stymo-bench: ";
        fail<Error>(row.name, ": ", reason.substr(reason.starts_with(prefix) ? prefix.size() : 0));
    }
    Row cells = row_from_json(columns(), own.out);
    const auto at = [&](const char* key) -> Value& { return cell(columns(), cells, key); };
    // JSON has no infinity.
    if (at("equal_images") == Value(true))
        at("psnr_mean_db") = at("psnr_worst_db") = std::numeric_limits<double>::infinity();
    if (!program.script.empty() && !row.peer.empty()) {
        const ChildOutcome peer = run_peer(program, row.peer, decoder, threads, options);
        std::smatch found;  // "render: 1100.0 ms (...)"
        if (peer.exit_code != 0 ||
            !std::regex_search(peer.out, found, std::regex(row.peer + R"(: ([0-9.]+) ms)")))
            fail<Error>(program.script.string(), ": ", row.peer,
                        " was not measured: ", last_line(peer.err), "; leave out --peer");
        const double seconds = std::stod(found[1]) / 1e3;
        at("peer_median_seconds") = seconds;
        at("times_peer") = seconds / std::get<double>(at("median_seconds"));
        at("peer_peak_memory_mebibytes") = peer.peak_memory;
    }
    cells.erase(cells.begin(), cells.begin() + 2);
    return cells;
}

}  // namespace

Limit limit_of(MatmulPrecision precision) {
    return computed_precision(precision) == MatmulPrecision::medium ? Limit::bfloat16
                                                                    : Limit::float32;
}

std::vector<SpeedRow> speed_rows(const std::string& command) {
    std::vector<SpeedRow> chosen;
    for (const auto& rows : {frame_rows(), step_rows(), training_rows(), kernel_rows()})
        std::ranges::copy_if(rows, std::back_inserter(chosen), [&](const SpeedRow& row) {
            return command == "all" || row.command == command;
        });
    return chosen;
}

std::string missing_peer(const PeerProgram& program) {
    if (program.script.empty()) return "no --peer is named";
    if (!std::filesystem::is_regular_file(program.script))
        fail<FileError>(program.script.string(),
                        ": no such file; --peer names scripts/torch_peer.py of the project");
    const std::string python = program.python.string();
    if (run_child({python, "-c", "import torch, torchvision"}).exit_code == 0) return {};
    return python + " has no PyTorch (Debian: python3-torch python3-torchvision libopenblas0)";
}

Study speed_study(const std::string& command, const PeerProgram& program,
                  const DecoderConfig& decoder) {
    const auto plan = [=](const StudyInputs& inputs) {
        StudyPlan result;
        for (const SpeedRow& row : speed_rows(command))
            result.add({row.name, row.what}, [=, bench = inputs.bench] {
                return measured_apart(row, program, decoder, bench);
            });
        return result;
    };
    return {.part = command,
            .name = "rows",
            .title = "Speed",
            .varied = "what is computed",
            .measured = "time, memory of a process of its own, error of frames that leave out work",
            .reference = "the machine's peak, the exact frames, and the same work in PyTorch",
            .columns = columns(),
            .plan = plan};
}

AppResult bench_row(const std::string& name, const BenchOptions& options) {
    const std::vector<SpeedRow> all = speed_rows();
    const auto found = std::ranges::find(all, name, &SpeedRow::name);
    if (found == all.end())
        fail<UsageError>("there is no row ", name, "; stymo-bench rows lists them");
    const Row cells = measured_here(*found, options);
    return {markdown({"rows", columns(), {cells}}), to_json(columns(), cells)};
}

AppResult bench_row_names() {
    Table table{"rows", {"name", "command", "what"}};
    for (const SpeedRow& row : speed_rows())
        table.rows.push_back({row.name, row.command, row.what});
    return {markdown(table), JsonValue::object({{table.name, to_json(table)}})};
}

}  // namespace stymo
