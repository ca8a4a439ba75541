#include "apps/bench/report/write_report.h"

#include <algorithm>
#include <optional>
#include <sstream>

#include "apps/bench/report.h"
#include "apps/bench/report/section.h"
#include "apps/bench/report/small_model.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/folder_in_progress.h"
#include "core/parallel.h"
#include "core/progress.h"

namespace stymo {

namespace {

std::vector<std::string> names_in(const std::string& list) {
    std::vector<std::string> names;
    std::istringstream stream(list);
    for (std::string name; std::getline(stream, name, ',');) names.push_back(name);
    return names;
}

bool has_inputs(const ReportSection& section, const BenchOptions& bench) {
    return !section.needs_model || bench.model.empty() == bench.data.empty();
}

/// In the order of the report, whatever the order of `parts`.
std::vector<ReportSection> chosen_sections(const ReportOptions& options) {
    std::vector<ReportSection> sections = report_sections();
    if (options.parts.empty()) {
        std::erase_if(sections, [&](const ReportSection& section) { return !has_inputs(section, options.bench); });
        return sections;
    }
    const std::vector<std::string> names = names_in(options.parts);
    for (const std::string& name : names) {
        const auto found = std::ranges::find(sections, name, &ReportSection::name);
        if (found == sections.end())
            fail<UsageError>("--parts: the report has no part \"", name, "\"; it has ", report_section_names());
        if (!has_inputs(*found, options.bench)) fail<UsageError>("--parts: ", name, " needs --data with --model, or neither");
    }
    std::erase_if(sections, [&](const ReportSection& section) { return std::ranges::find(names, section.name) == names.end(); });
    return sections;
}

BenchOptions fitting_options(const ReportOptions& options) {
    BenchOptions fitting = options.bench;
    if (!options.fit_model.empty()) fitting.model = options.fit_model;
    if (!options.fit_data.empty()) fitting.data = options.fit_data;
    return fitting;
}

/// Serves the sections that need a model where none is given; trained on heads of its own.
BenchOptions small_subject(const std::filesystem::path& folder, BenchOptions bench, std::uint64_t seed) {
    constexpr double seconds = 45.0;
    bench.data = folder / "heads";
    bench.model = folder / "model.safetensors";
    std::filesystem::create_directory(bench.data);
    write_small_heads(bench.data, seed);
    write_small_model(bench.data, bench.model, seed, seconds);
    return bench;
}

std::string conditions(const ReportOptions& options, const CommonOptions& common) {
    return "Threads: " + std::to_string(thread_count()) + "; seed: " + std::to_string(common.seed) + "; model: " +
           (options.bench.model.empty() ? "a small one, trained for this report" : options.bench.model.filename().string()) + ".";
}

}  // namespace

std::string report_section_names() {
    std::string names;
    for (const ReportSection& section : report_sections()) names += (names.empty() ? "" : ",") + section.name;
    return names;
}

AppResult write_report(const ReportOptions& options, const CommonOptions& common) {
    const std::vector<ReportSection> sections = chosen_sections(options);
    FolderInProgress folder(options.out);
    ReportWriter report(folder.path());
    report.title(1, "Error against run time, and numerical stability");
    report.text(conditions(options, common));
    const InterruptGuard guard;
    Progress progress({.title = "report", .total = std::ssize(sections), .unit = {}});
    std::vector<std::vector<ReportCell>> times;
    ReportOptions given = options;
    std::optional<FolderInProgress> small;
    if (options.bench.model.empty() && std::ranges::any_of(sections, &ReportSection::needs_model)) {
        progress.update(0, "small model");
        small.emplace(std::filesystem::temp_directory_path() / "stymo-report-model");
        given.bench = small_subject(small->path(), options.bench, common.seed);
    }
    for (const ReportSection& section : sections) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        progress.update(std::ssize(times), section.name);
        report.title(2, section.title);
        const double begin = seconds_now();
        section.write(report, {given.bench, fitting_options(given), given.lpips, common.seed, section.seconds});
        times.push_back({section.name, seconds_now() - begin, section.seconds});
    }
    progress.finish();
    report.title(2, "Time that this report took");
    report.table("report_times", {"part", "seconds", "seconds allowed"}, times);
    report.finish();
    folder.finish();

    std::vector<JsonValue> parts;
    std::string lines;
    for (const auto& time : times) {
        parts.push_back(JsonValue::object({{"name", time[0].value}, {"seconds", time[1].value}}));
        lines += time[0].text + ": " + time[1].text + " s\n";
    }
    return {lines + (options.out / "report.md").string() + "\n", JsonValue::object({{"parts", parts}})};
}

}  // namespace stymo
