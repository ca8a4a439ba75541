#include "apps/bench/report.h"

#include <algorithm>
#include <optional>
#include <sstream>

#include "apps/bench/small_model.h"
#include "apps/bench/study.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/folder_in_progress.h"
#include "core/parallel.h"

namespace stymo {

namespace {

std::vector<std::string> names_in(const std::string& list) {
    std::vector<std::string> names;
    std::istringstream stream(list);
    for (std::string name; std::getline(stream, name, ',');) names.push_back(name);
    return names;
}

/// In the order of the report, whatever the order of `parts`.
std::vector<Study> chosen_studies(const ReportOptions& options) {
    const auto has_inputs = [&](const Study& study) {
        return !study.needs_model || options.bench.model.empty() == options.bench.data.empty();
    };
    std::vector<Study> studies = report_studies();
    if (options.parts.empty()) {
        std::erase_if(studies, std::not_fn(has_inputs));
        return studies;
    }
    const std::vector<std::string> names = names_in(options.parts);
    for (const std::string& name : names) {
        const auto found = std::ranges::find(studies, name, &Study::name);
        if (found == studies.end())
            fail<UsageError>("--parts: the report has no part \"", name, "\"; it has ",
                             report_study_names());
        if (!has_inputs(*found))
            fail<UsageError>("--parts: ", name, " needs --data with --model, or neither");
    }
    std::erase_if(studies, [&](const Study& study) {
        return std::ranges::find(names, study.name) == names.end();
    });
    return studies;
}

/// A model for the studies that need one where none is given, trained on synthetic heads.
BenchOptions small_subject(const std::filesystem::path& folder, BenchOptions bench,
                           std::uint64_t seed) {
    constexpr double seconds = 45.0;
    bench.data = folder / "heads";
    bench.model = folder / "model.safetensors";
    std::filesystem::create_directory(bench.data);
    write_small_heads(bench.data, seed);
    write_small_model(bench.data, bench.model, seed, seconds);
    return bench;
}

}  // namespace

std::string report_study_names() {
    std::string names;
    for (const Study& study : report_studies()) names += (names.empty() ? "" : ",") + study.name;
    return names;
}

AppResult write_report(const ReportOptions& options, const CommonOptions& common) {
    const std::vector<Study> studies = chosen_studies(options);
    for (const std::filesystem::path& model : {options.bench.model, options.fit_model})
        if (!model.empty() && !std::filesystem::exists(model))
            fail<FileError>(model.string(), ": no such file");
    FolderInProgress folder(options.out);
    Page page("report", folder.path());
    page.title(1, "Error against run time, and numerical stability");
    page.text("Threads: " + std::to_string(thread_count()) +
              "; seed: " + std::to_string(common.seed) + "; model: " +
              (options.bench.model.empty() ? "a small one, trained for this report"
                                           : options.bench.model.filename().string()) +
              ".");
    const InterruptGuard guard;
    StudyInputs inputs{
        .bench = options.bench, .fitting = {}, .lpips = options.lpips, .seed = common.seed};
    std::optional<FolderInProgress> small;
    if (options.bench.model.empty() && std::ranges::any_of(studies, &Study::needs_model)) {
        small.emplace(std::filesystem::temp_directory_path() / "stymo-report-model");
        inputs.bench = small_subject(small->path(), options.bench, common.seed);
    }
    inputs.fitting = inputs.bench;
    if (!options.fit_model.empty()) inputs.fitting.model = options.fit_model;
    if (!options.fit_data.empty()) inputs.fitting.data = options.fit_data;
    Table times{.name = "parts",
                .columns = {{"name", "part"},
                            {"seconds", "seconds", fixed<1>},
                            {"seconds_allowed", "seconds allowed"}}};
    for (const Study& study : studies) {
        page.title(2, study.title);
        inputs.seconds = study.seconds;
        const double begin = seconds_now();
        study.write(page, inputs);
        times.rows.push_back({study.name, seconds_now() - begin, study.seconds});
    }
    page.title(2, "Time that this report took");
    page.add(times);
    static_cast<void>(page.finish());
    folder.finish();
    return {markdown(times) + (options.out / "report.md").string() + "\n",
            JsonValue::object({{times.name, to_json(times)}})};
}

}  // namespace stymo
