#include "apps/bench/report.h"

#include <algorithm>
#include <iostream>
#include <optional>
#include <sstream>

#include "apps/bench/peak.h"
#include "apps/bench/training.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/folder_in_progress.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"

namespace stymo {

namespace {

JsonValue to_json(const kernels::MachinePeak& peak) {
    return JsonValue::object({{"float32_flops", peak.multiply_adds},
                              {"bfloat16_flops", peak.bfloat16_multiply_adds},
                              {"triad_bytes_per_second", peak.triad_bytes}});
}

/// In the order of the report, whatever the order of `options.parts`.
std::vector<Study> chosen_studies(const ReportOptions& options) {
    const auto lacks_inputs = [&](const Study& study) {
        return study.needs_model && options.bench.model.empty() != options.bench.data.empty();
    };
    std::vector<Study> studies = report_studies();
    if (options.parts.empty()) {
        std::erase_if(studies, lacks_inputs);
        return studies;
    }
    std::vector<std::string> parts;
    std::istringstream list(options.parts);
    for (std::string part; std::getline(list, part, ',');) {
        const auto found = std::ranges::find(studies, part, &Study::part);
        if (found == studies.end())
            fail<UsageError>("--parts: the report has no part \"", part, "\"; it has ",
                             report_parts());
        if (lacks_inputs(*found))
            fail<UsageError>("--parts: ", part, " needs --data with --model, or neither");
        parts.push_back(part);
    }
    std::erase_if(studies, [&](const Study& study) {
        return std::ranges::find(parts, study.part) == parts.end();
    });
    return studies;
}

/// A model for the studies that need one where none is given, trained on synthetic heads.
void write_small_subject(const std::filesystem::path& folder, BenchOptions& bench) {
    constexpr double seconds = 45.0;
    bench.data = folder / "heads";
    bench.model = folder / "model.safetensors";
    std::filesystem::create_directory(bench.data);
    write_small_heads(bench.data, bench.seed);
    write_small_model(bench.data, bench.model, bench.seed, seconds);
}

}  // namespace

AppResult bench_session(const std::string& command, const ReportOptions& options) {
    // A model or a peer that is not there is reported before anything is measured.
    const DecoderConfig decoder = make_subject(options.bench).model.config().decoder;
    PeerProgram peer = options.peer;
    const std::string missing = missing_peer(peer);
    if (!missing.empty()) peer.script.clear();
    if (!options.out.empty()) require_writable_folder(options.out);
    const std::vector<SpeedRow> rows = speed_rows();
    const auto belongs = [&](const SpeedRow& row) {
        return command == "all" || row.command == command;
    };
    if (!missing.empty() && std::ranges::any_of(rows, [&](const SpeedRow& row) {
            return belongs(row) && !row.peer.empty();
        }))
        std::cerr << "no peer: " << missing << std::endl;

    const bool all = command == "all";
    std::vector<Study> studies;
    if (std::ranges::any_of(rows, belongs)) studies.push_back(speed_study(command, peer, decoder));
    if (all || command == "curve" || (command == "render" && !options.out.empty()))
        studies.push_back(rendering_study());
    if (all || command == "growth") studies.push_back(growth_study());
    if (command == "cores") studies.push_back(cores_study());
    if (command == "bias") studies.push_back(bias_study());

    Page page(command, options.out);
    const JsonValue peak = to_json(kernels::measure_machine_peak());
    page.fact("threads", thread_count());
    page.fact("precision of matrix products", name_of(matmul_precision()));
    page.fact("peak", peak);
    page.fact("model", options.bench.model.empty() ? "random weights, paper-512"
                                                   : options.bench.model.string());
    for (const Study& study : studies) run_study(page, study, {.bench = options.bench});
    page.text("Threads: " + std::to_string(thread_count()) + "; peak: " + peak.text());
    return page.finish();
}

AppResult write_report(const ReportOptions& options) {
    const std::vector<Study> studies = chosen_studies(options);
    for (const std::filesystem::path& model : {options.bench.model, options.fit_model})
        if (!model.empty() && !std::filesystem::exists(model))
            fail<FileError>(model.string(), ": no such file");
    FolderInProgress folder(options.out);
    const InterruptGuard guard;
    StudyInputs inputs{.bench = options.bench, .lpips = options.lpips};
    std::optional<FolderInProgress> small;
    if (options.bench.model.empty() && std::ranges::any_of(studies, &Study::needs_model)) {
        small.emplace(std::filesystem::temp_directory_path() / "stymo-report-model");
        write_small_subject(small->path(), inputs.bench);
    }
    inputs.fitting = inputs.bench;
    if (!options.fit_model.empty()) inputs.fitting.model = options.fit_model;
    if (!options.fit_data.empty()) inputs.fitting.data = options.fit_data;

    Page page("report", folder.path());
    page.text("# Error against run time, and numerical stability");
    page.text("Threads: " + std::to_string(thread_count()) +
              "; seed: " + std::to_string(options.bench.seed) + "; model: " +
              (options.bench.model.empty() ? "a small one, trained for this report"
                                           : options.bench.model.filename().string()) +
              ". `scripts/plot_reports.py` draws the curves from the CSV files.");
    Table times{"parts", {"name", "seconds", "seconds_allowed"}};
    for (const Study& study : studies) {
        inputs.seconds = study.seconds;
        const double begin = seconds_now();
        run_study(page, study, inputs);
        if (times.rows.empty() || times.rows.back()[0] != Value(study.part))
            times.rows.push_back({study.part, 0.0, 0.0});
        std::get<double>(times.rows.back()[1]) += seconds_now() - begin;
        std::get<double>(times.rows.back()[2]) += study.seconds;
    }
    page.text("## Time that this report took");
    page.add(times);
    static_cast<void>(page.finish());
    folder.finish();
    return {markdown(times) + (options.out / "report.md").string() + "\n",
            JsonValue::object({{times.name, to_json(times)}})};
}

std::string report_parts() {
    std::string parts;
    std::string last;
    for (const Study& study : report_studies()) {
        if (study.part != last) parts += (parts.empty() ? "" : ",") + study.part;
        last = study.part;
    }
    return parts;
}

}  // namespace stymo
