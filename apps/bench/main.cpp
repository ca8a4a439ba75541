#include <string>
#include <utility>
#include <vector>

#include "apps/bench/report.h"
#include "apps/common/tools.h"

namespace {

void declare(stymo::Command& command, stymo::BenchOptions& options) {
    command.option(
        "--model", options.model,
        "model.safetensors of a training run; without one paper-512 with random weights");
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

int stymo_bench(int argc, char** argv) {
    stymo::ReportOptions options;
    std::string row;
    stymo::CommandLine line("stymo-bench",
                            "Measures speed, with its ratio to the machine's peak and to PyTorch, "
                            "and what it costs in error.");
    const auto seeded = [&](auto body) {
        return [&options, body](const stymo::CommonOptions& common) {
            options.bench.seed = common.seed;
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
        {"growth", "How the time of a frame grows with samples, size, width and threads."},
        {"all", "All of these."},
        {"cores",
         "What frames, fits, tuning, training and preparation would gain from more processors."},
        {"bias", "What leaving out samples does to a fit's gradient and outcome; takes minutes."}};
    for (const auto& [name, description] : sessions) {
        const auto body = [&options, name = name] { return stymo::bench_session(name, options); };
        stymo::Command command = line.command(name, description, seeded(body));
        declare(command, options.bench);
        if (name == "bias")
            command.option("--steps", options.bench.steps, "of each fit").range(1, 10000);
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
    stymo::Command one = line.command("row", "One row in this process, without the peer.",
                                      seeded([&] { return stymo::bench_row(row, options.bench); }));
    one.option("NAME", row, "the row").required();
    declare(one, options.bench);
    stymo::Command report =
        line.command("report", "Error against run time and numerical stability, as tables.",
                     seeded([&] { return stymo::write_report(options); }));
    report.option("--out", options.out, "folder for report.md with its tables").required();
    report.option(
        "--parts", options.parts,
        "some of " + stymo::report_parts() + "; without it all that the inputs are there for");
    report.option(
        "--fit-model", options.fit_model,
        "model of the part on fitting, which takes hundreds of steps; --model unless given");
    report.option("--fit-data", options.fit_data, "its photos; --data unless given");
    stymo::declare_lpips_files(report, options.lpips);
    declare(report, options.bench);
    line.command("rows", "Lists all rows.",
                 [](const stymo::CommonOptions&) { return stymo::bench_row_names(); });
    return line.run(argc, argv);
}
