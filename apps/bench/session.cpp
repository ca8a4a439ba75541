#include "apps/bench/session.h"

#include <algorithm>
#include <iostream>

#include "apps/bench/case.h"
#include "apps/bench/curve.h"
#include "apps/bench/fit_bias.h"
#include "apps/bench/growth.h"
#include "apps/bench/peer.h"
#include "apps/bench/report.h"
#include "apps/common/child_process.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/parallel.h"
#include "core/progress.h"

namespace stymo {

namespace {

constexpr const char* everything = "all";

/// The line that this program, run as a child, says why it failed in.
std::string reason_in(const std::string& err) {
    const std::string prefix = "stymo-bench: ";
    const std::size_t place = err.rfind(prefix);
    if (place == std::string::npos) return "it ended without a word";
    const std::string line = err.substr(place + prefix.size());
    return line.substr(0, line.find('\n'));
}

BenchRow measured_apart(const BenchCase& bench_case, const BenchOptions& options, const CommonOptions& common) {
    std::vector<std::string> words{own_program(), "row", bench_case.name, "--json", "--seed", std::to_string(common.seed)};
    const auto add = [&](const char* option, const std::string& value) {
        words.emplace_back(option);
        words.push_back(value);
    };
    add("--threads", std::to_string(bench_case.threads > 0 ? bench_case.threads : thread_count()));
    add("--repeats", std::to_string(options.repeats));
    add("--faces", std::to_string(options.faces));
    add("--views", std::to_string(options.views));
    add("--samples", std::to_string(options.samples));
    if (!options.model.empty()) add("--model", options.model.string());
    if (!options.data.empty()) add("--data", options.data.string());
    const ChildOutcome outcome = run_child(words);
    if (outcome.exit_code != 0) fail<Error>(bench_case.name, ": ", reason_in(outcome.err));
    return row_from_json(outcome.out);
}

/// The slow ones once less often.
int peer_repeats(const std::string& what, int repeats) {
    constexpr int most = 3;
    return what == "r1" ? 1 : std::min(repeats, most);
}

std::vector<BenchRow> measure_rows(const std::vector<BenchCase>& cases, const Peer& peer, const BenchOptions& options,
                                   const CommonOptions& common) {
    const InterruptGuard guard;
    Progress progress({.title = "bench", .total = std::ssize(cases), .unit = {}});
    std::vector<BenchRow> rows;
    for (const BenchCase& bench_case : cases) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        progress.update(std::ssize(rows), bench_case.name);
        BenchRow row = measured_apart(bench_case, options, common);
        row.peer = peer.measure(bench_case.peer, row.threads, peer_repeats(bench_case.peer, options.repeats));
        rows.push_back(row);
    }
    progress.update(std::ssize(rows));
    progress.finish();
    return rows;
}

/// Result and files of a command, part by part.
class Report {
public:
    Report(const std::string& command, const std::filesystem::path& out) : command_(command), out_(out) {}

    void add(const std::string& part, const Cells& cells, const Cells& numbers, const JsonValue& json) {
        const std::string table = markdown(cells);
        result_.text += (result_.text.empty() ? "" : "\n") + table;
        result_.json.add(part, json);
        files_.emplace_back(command_ + (part == "rows" ? "" : "_" + part) + ".csv", csv(numbers));
    }
    void add_note(const std::string& text) { result_.text += "\n" + text; }
    void add_value(const std::string& key, const JsonValue& value) { result_.json.add(key, value); }
    void add_file(const std::string& name, const std::string& contents) { files_.emplace_back(name, contents); }

    /// Writes the files, if there is a folder for them.
    [[nodiscard]] AppResult finish() {
        if (!out_.empty()) {
            for (const auto& [name, contents] : files_) write_text_file(out_ / name, contents);
            write_text_file(out_ / (command_ + ".md"), result_.text);
            write_text_file(out_ / (command_ + ".json"), result_.json.text() + "\n");
        }
        return result_;
    }

private:
    std::string command_;
    std::filesystem::path out_;
    AppResult result_;
    std::vector<std::pair<std::string, std::string>> files_;
};

void add_curve(Report& report, const BenchSubject& subject, const BenchOptions& options) {
    const std::vector<CurvePoint> points = measure_curve(subject, options);
    report.add("curve", curve_cells(points), curve_cells(points), to_json(points));
    const Plot plot = error_plot(points);
    if (!plot.series.empty()) report.add_file("error_against_time.svg", to_svg(plot));
}

}  // namespace

AppResult bench_session(const std::string& command, const SessionOptions& options, const CommonOptions& common) {
    std::vector<BenchCase> cases = bench_cases();
    std::erase_if(cases, [&](const BenchCase& one) { return command != everything && one.command != command; });
    // The plot belongs to what --out adds.
    const bool curve = command == "curve" || command == everything || (command == "render" && !options.out.empty());
    const bool growth = command == "growth" || command == everything;
    const BenchSubject subject = make_subject(options.bench, common.seed);
    const Peer peer(options.peer, subject.model.config().decoder, options.bench.samples);
    if (!options.out.empty()) require_writable_folder(options.out);
    const bool compared = std::ranges::any_of(cases, [](const BenchCase& one) { return !one.peer.empty(); });
    if (compared && !peer.missing().empty()) std::cerr << "no peer: " << peer.missing() << std::endl;

    Report report(command, options.out);
    const kernels::MachinePeak peak = kernels::measure_machine_peak();
    report.add_value("threads", thread_count());
    report.add_value("peak", to_json(peak));
    report.add_value("model", options.bench.model.empty() ? "random weights, paper-512" : options.bench.model.string());
    if (!cases.empty()) {
        const std::vector<BenchRow> rows = measure_rows(cases, peer, options.bench, common);
        std::vector<JsonValue> json;
        for (const BenchRow& row : rows) json.push_back(to_json(row));
        report.add("rows", cells(rows), full_cells(rows), json);
    }
    if (curve) add_curve(report, subject, options.bench);
    if (growth) {
        const std::vector<GrowthPoint> points = measure_growth(subject, options.bench, common.seed);
        report.add("growth", growth_cells(points), growth_cells(points), to_json(points));
    }
    if (command == "bias") {
        const std::vector<FitBias> rows = measure_fit_bias(subject, options.bench);
        report.add("bias", fit_bias_cells(rows), fit_bias_cells(rows), to_json(rows));
    }
    report.add_note("threads: " + std::to_string(thread_count()) + "; " + text(peak));
    return report.finish();
}

AppResult bench_row(const std::string& name, const BenchOptions& options, const CommonOptions& common) {
    const BenchRow row = measure_row(case_named(name), {options, common.seed});
    return {markdown(cells({row})), to_json(row)};
}

AppResult bench_row_names() {
    Cells table{{"row", "command", "what"}};
    std::vector<JsonValue> json;
    for (const BenchCase& one : bench_cases()) {
        table.push_back({one.name, one.command, one.what});
        json.push_back(JsonValue::object({{"name", one.name}, {"command", one.command}, {"what", one.what}}));
    }
    return {markdown(table), JsonValue::object({{"rows", json}})};
}

}  // namespace stymo
