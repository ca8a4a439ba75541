#include <algorithm>
#include <iostream>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "apps/bench/peak.h"
#include "apps/bench/study.h"
#include "apps/common/tools.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/io/file.h"
#include "core/io/folder_in_progress.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"
#include "fit/shipped_files.h"

namespace stymo {

namespace {

struct ReportOptions {
    /// The model and the photos of fits are those of `inputs.bench` if they are empty.
    StudyInputs inputs;
    std::filesystem::path out{};  ///< empty: nothing is written
    PeerProgram peer{};           ///< of the commands with rows
    std::string parts{};  ///< separated by commas; empty: all parts whose inputs are available
};

/// The names of all parts: "rendering,fitting,...".
std::string report_parts() {
    std::string parts, last;
    for (const Study& study : report_studies())
        if (study.part != last) parts += (parts.empty() ? "" : ",") + (last = study.part);
    return parts;
}

/// In the order of the report, whatever the order of `options.parts`. Throws UsageError for an
/// unknown part, and for one that needs a model if only one of --model and --data was given.
std::vector<Study> chosen_studies(const ReportOptions& options) {
    const BenchOptions& bench = options.inputs.bench;
    std::vector<Study> studies = report_studies();
    std::set<std::string> parts;
    std::istringstream list(options.parts);
    for (std::string part; std::getline(list, part, ',');) {
        if (std::ranges::find(studies, part, &Study::part) == studies.end())
            fail<UsageError>("--parts: the report has no part \"", part, "\"; it has ",
                             report_parts());
        parts.insert(part);
    }
    std::erase_if(studies, [&](const Study& study) {
        if (!options.parts.empty() && !parts.contains(study.part)) return true;
        const bool lacks_inputs = study.needs_model && bench.model.empty() != bench.data.empty();
        if (lacks_inputs && !options.parts.empty())
            fail<UsageError>("--parts: ", study.part, " needs --data with --model, or neither");
        return lacks_inputs;
    });
    return studies;
}

/// Runs the studies of a command: its rows of the table of speeds, the curve, or the cores. Files
/// in `out` are named after the command.
AppResult bench_session(const std::string& command, const ReportOptions& options) {
    // A model or a peer that is not there is reported before anything is measured.
    const BenchOptions& bench = options.inputs.bench;
    const DecoderConfig decoder = make_subject(bench).model.config().decoder;
    PeerProgram peer = options.peer;
    const std::string missing = missing_peer(peer);
    if (!missing.empty()) peer.script.clear();
    if (!options.out.empty()) require_writable_folder(options.out);
    const std::vector<SpeedRow> rows = speed_rows(command);
    if (!missing.empty() && !std::ranges::all_of(rows, &std::string::empty, &SpeedRow::peer))
        std::cerr << "no peer: " << missing << std::endl;

    std::vector<Study> studies;
    if (!rows.empty()) studies.push_back(speed_study(command, peer, decoder));
    if (command == "all" || command == "curve" || (command == "render" && !options.out.empty()))
        studies.push_back(rendering_study());
    if (command == "cores") studies.push_back(cores_study());

    Page page(command, options.out);
    const kernels::MachinePeak machine = kernels::measure_machine_peak();
    const JsonValue peak = JsonValue::object({{"float32_flops", machine.multiply_adds},
                                              {"bfloat16_flops", machine.bfloat16_multiply_adds}});
    page.fact("threads", thread_count());
    page.fact("precision of matrix products", name_of(matmul_precision()));
    page.fact("peak", peak);
    page.fact("model", bench.model.empty() ? "random weights, paper-512" : bench.model.string());
    for (const Study& study : studies) run_study(page, study, {.bench = bench});
    page.text("Threads: " + std::to_string(thread_count()) + "; peak: " + peak.text());
    return page.finish();
}

/// Writes report.md with its tables. The folder is created when all studies are done.
AppResult write_report(const ReportOptions& options) {
    const std::vector<Study> studies = chosen_studies(options);
    StudyInputs inputs = options.inputs;
    for (const std::filesystem::path& model : {inputs.bench.model, inputs.fitting.model})
        if (!model.empty() && !std::filesystem::exists(named_model(model)))
            fail<FileError>(model.string(), ": no such file");
    FolderInProgress folder(options.out);
    const InterruptGuard guard;
    std::optional<FolderInProgress> small;
    if (inputs.bench.model.empty() && std::ranges::any_of(studies, &Study::needs_model)) {
        small.emplace(std::filesystem::temp_directory_path() / "stymo-report-model");
        train_small_subject(small->path(), inputs.bench);
    }
    inputs.fitting = inputs.bench;
    if (!options.inputs.fitting.model.empty()) inputs.fitting.model = options.inputs.fitting.model;
    if (!options.inputs.fitting.data.empty()) inputs.fitting.data = options.inputs.fitting.data;

    Page page("report", folder.path());
    page.text("# Error against run time");
    page.text("Threads: " + std::to_string(thread_count()) +
              "; seed: " + std::to_string(inputs.bench.seed) + "; model: " +
              (options.inputs.bench.model.empty() ? "a small one, trained for this report"
                                                  : inputs.bench.model.filename().string()) +
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

void declare(Command& command, BenchOptions& options) {
    command.option("--model", options.model,
                   "model.safetensors of a training run, or the name of a model that comes with "
                   "stymo; without one paper-512 with random weights");
    command.option(
        "--data", options.data,
        "folder of photos in FFHQ format whose codes are shown; without one random ones");
    command
        .option("--repeats", options.repeats,
                "measurements of each time, of which the median counts")
        .range(1, 1000);
    command.option("--faces", options.faces, "number of faces").range(1, 1000);
    command
        .option("--views", options.views,
                "views of each face that errors are measured on; every timed frame is another one "
                "than the frame before")
        .range(2, 1000);
    command.option("--samples", options.samples, "samples per ray").range(2, 4096);
}

}  // namespace

}  // namespace stymo

int stymo_bench(int argc, char** argv) {
    using namespace stymo;
    ReportOptions options;
    std::string row;
    CommandLine line("stymo-bench",
                     "Measures speed, with its ratio to the machine's peak and to PyTorch, "
                     "and what it costs in error.");
    const auto seeded = [&](auto body) {
        return [&options, body](const CommonOptions& common) {
            options.inputs.bench.seed = common.seed;
            return body();
        };
    };
    const std::vector<std::pair<std::string, std::string>> sessions{
        {"render",
         "Frames: exact, with empty samples skipped, in 16 bits; with --out also the curve."},
        {"edit", "Texture and light of a shown view."},
        {"fit", "Steps of fitting."},
        {"train", "Steps of the first training stage."},
        {"training", "Whole steps of the first stage with the configurations for small models."},
        {"disc", "Updates of the discriminator."},
        {"kernels", "A layer of the field by itself."},
        {"curve", "Error against frame time over samples, tolerance and precision."},
        {"all", "All of these."},
        {"cores",
         "What frames, fits, tuning, training and preparation would gain from more processors."}};
    for (const auto& [name, description] : sessions) {
        const auto body = [&options, name = name] { return bench_session(name, options); };
        Command command = line.command(name, description, seeded(body));
        declare(command, options.inputs.bench);
        command.option(
            "--peer", options.peer.script,
            "scripts/torch_peer.py, the same in PyTorch, or scripts/onnx_peer.py, frames in "
            "OpenVINO and ONNX Runtime: run beside each row");
        command.option("--peer-python", options.peer.python,
                       "Python that has what the script needs");
        command.option("--out", options.out,
                       "folder for the tables as JSON, CSV and Markdown; scripts/plot_reports.py "
                       "draws them");
    }
    Command one = line.command("row", "One row in this process, without the peer.",
                               seeded([&] { return bench_row(row, options.inputs.bench); }));
    one.option("NAME", row, "the row").required();
    declare(one, options.inputs.bench);
    Command report = line.command("report", "Error against run time, as tables.",
                                  seeded([&] { return write_report(options); }));
    report.option("--out", options.out, "folder for report.md with its tables").required();
    report.option("--parts", options.parts,
                  "some of " + report_parts() + "; without it all that the inputs are there for");
    report.option(
        "--fit-model", options.inputs.fitting.model,
        "model of the part on fitting, which takes hundreds of steps; --model unless given");
    report.option("--fit-data", options.inputs.fitting.data, "its photos; --data unless given");
    declare_lpips_files(report, options.inputs.lpips);
    declare(report, options.inputs.bench);
    line.command("rows", "Lists all rows.", [](const CommonOptions&) { return bench_row_names(); });
    return line.run(argc, argv);
}
