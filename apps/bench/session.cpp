#include "apps/bench/session.h"

#include <algorithm>
#include <iostream>
#include <limits>

#include "apps/bench/case.h"
#include "apps/bench/peak.h"
#include "apps/bench/peer.h"
#include "apps/bench/study.h"
#include "apps/common/child_process.h"
#include "core/error.h"
#include "core/io/file.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"

namespace stymo {

namespace {

constexpr const char* everything = "all";

/// The line in which this program, run as a child, says why it failed.
std::string reason_in(const std::string& err) {
    const std::string prefix = "stymo-bench: ";
    const std::size_t place = err.rfind(prefix);
    if (place == std::string::npos) return "it ended without a message";
    const std::string line = err.substr(place + prefix.size());
    return line.substr(0, line.find('\n'));
}

/// Fewer repetitions for slow measurements.
int peer_repeats(const std::string& what, int repeats) {
    constexpr int most = 3;
    return what == "r1" ? 1 : std::min(repeats, most);
}

/// Measures a row in a separate process, so that its peak memory is known, and the peer directly
/// after it.
Row measured_apart(const BenchCase& bench_case, const Peer& peer, const BenchOptions& options,
                   std::uint64_t seed) {
    const int threads = bench_case.threads > 0 ? bench_case.threads : thread_count();
    std::vector<std::string> words{own_program(), "row", bench_case.name, "--json"};
    const auto add = [&](const char* option, const std::string& value) {
        if (!value.empty()) words.insert(words.end(), {option, value});
    };
    add("--seed", std::to_string(seed));
    add("--threads", std::to_string(threads));
    add("--matmul-precision", name_of(matmul_precision()));
    add("--repeats", std::to_string(options.repeats));
    add("--faces", std::to_string(options.faces));
    add("--views", std::to_string(options.views));
    add("--samples", std::to_string(options.samples));
    add("--model", options.model.string());
    add("--data", options.data.string());
    const ChildOutcome outcome = run_child(words);
    if (outcome.exit_code != 0) fail<Error>(bench_case.name, ": ", reason_in(outcome.err));
    Table table{.name = {}, .columns = case_columns(), .rows = {}};
    Row row = row_from_json(table.columns, outcome.out);
    const auto cell = [&](const char* key) -> Value& {
        const auto found = std::ranges::find(table.columns, key, &Column::key);
        return row[static_cast<std::size_t>(found - table.columns.begin())];
    };
    // JSON has no infinity.
    if (cell("equal_images") == Value(true))
        cell("psnr_mean_db") = cell("psnr_worst_db") = std::numeric_limits<double>::infinity();
    if (const auto peers = peer.measure(bench_case.peer, threads,
                                        peer_repeats(bench_case.peer, options.repeats))) {
        cell("peer_median_seconds") = peers->seconds;
        cell("times_peer") = peers->seconds / table.number(row, "median_seconds");
        cell("peer_peak_memory_mebibytes") = peers->peak_memory;
    }
    row.erase(row.begin(), row.begin() + 2);
    return row;
}

std::string text_of(const kernels::MachinePeak& peak) {
    const auto rate = [](double flops, const char* type) {
        return flops > 0.0 ? decimal(flops / 1e9, 0) + " GFLOP/s " + type + ", " : std::string();
    };
    return "threads: " + std::to_string(thread_count()) +
           "; peak: " + rate(peak.multiply_adds, "float32") +
           rate(peak.bfloat16_multiply_adds, "bfloat16") +
           rate(peak.float16_multiply_adds, "float16") + decimal(peak.triad_bytes / 1e9, 1) +
           " GB/s";
}

JsonValue to_json(const kernels::MachinePeak& peak) {
    return JsonValue::object({{"float32_flops", peak.multiply_adds},
                              {"bfloat16_flops", peak.bfloat16_multiply_adds},
                              {"float16_flops", peak.float16_multiply_adds},
                              {"triad_bytes_per_second", peak.triad_bytes}});
}

/// The studies that belong to a command.
std::vector<Study> studies_of(const std::string& command, bool writes_files) {
    const bool all = command == everything;
    std::vector<Study> studies;
    if (all || command == "curve" || (command == "render" && writes_files))
        studies.push_back(rendering_study());
    if (all || command == "growth") studies.push_back(growth_study());
    if (command == "bias") studies.push_back(bias_study());
    return studies;
}

}  // namespace

AppResult bench_session(const std::string& command, const SessionOptions& options,
                        const CommonOptions& common) {
    std::vector<BenchCase> cases = bench_cases();
    std::erase_if(cases, [&](const BenchCase& one) {
        return command != everything && one.command != command;
    });
    // A model or a peer that is not there is reported before anything is measured.
    const Peer peer(options.peer, make_subject(options.bench, common.seed).model.config().decoder,
                    options.bench.samples);
    if (!options.out.empty()) require_writable_folder(options.out);
    const bool compared =
        std::ranges::any_of(cases, [](const BenchCase& one) { return !one.peer.empty(); });
    if (compared && !peer.missing().empty())
        std::cerr << "no peer: " << peer.missing() << std::endl;

    Page page(command, options.out);
    const kernels::MachinePeak peak = kernels::measure_machine_peak();
    page.fact("threads", thread_count());
    page.fact("precision of matrix products", name_of(matmul_precision()));
    page.fact("peak", to_json(peak));
    page.fact("model", options.bench.model.empty() ? "random weights, paper-512"
                                                   : options.bench.model.string());
    std::vector<StudyRow> rows;
    for (const BenchCase& one : cases)
        rows.push_back({{one.name, one.what}, [&, one] {
                            return measured_apart(one, peer, options.bench, common.seed);
                        }});
    if (!rows.empty())
        page.add(run_study({.name = "rows", .columns = case_columns(), .rows = {}}, rows));
    for (const Study& study : studies_of(command, !options.out.empty()))
        study.write(page, {.bench = options.bench,
                           .fitting = options.bench,
                           .seed = common.seed,
                           .seconds = std::numeric_limits<double>::infinity()});
    page.text(text_of(peak));
    return page.finish();
}

AppResult bench_row(const std::string& name, const BenchOptions& options,
                    const CommonOptions& common) {
    const BenchCase one = case_named(name);
    Row row = measure_case(one, {options, common.seed});
    row.insert(row.begin(), {one.name, one.what});
    const Table table{.name = "rows", .columns = case_columns(), .rows = {row}};
    return {markdown(table), to_json(table.columns, row)};
}

AppResult bench_row_names() {
    Table table{.name = "rows",
                .columns = {{"name", "row"}, {"command", "command"}, {"what", "what"}},
                .rows = {}};
    for (const BenchCase& one : bench_cases())
        table.rows.push_back({one.name, one.command, one.what});
    return {markdown(table), JsonValue::object({{table.name, to_json(table)}})};
}

}  // namespace stymo
