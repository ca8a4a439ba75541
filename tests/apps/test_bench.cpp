// stymo-bench on the smallest model: every command runs, results parse, docs/results.md
// lists every row.
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "apps/common/child_process.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::run_tool;
using stymo::tiny_run;
using stymo::ToolOutcome;

const std::string small =
    " --model run/model.safetensors --repeats 1 --faces 1 --views 2 --samples 4 ";

ToolOutcome done(const std::string& command) {
    ToolOutcome outcome = run_tool(tiny_run(), command);
    INFO(command << "\n" << outcome.err);
    CHECK(outcome.exit_code == 0);
    return outcome;
}

json rows_listed() {
    return json::parse(done("stymo-bench rows --json").out)["rows"];
}

/// First cells of a Markdown table's rows, in backquotes: | `name` | ...
std::set<std::string> names_in_table(const std::string& text) {
    std::set<std::string> names;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        const std::string opening = "| `";
        if (line.starts_with(opening))
            names.insert(
                line.substr(opening.size(), line.find('`', opening.size()) - opening.size()));
    }
    return names;
}

std::string section(const std::string& text, const std::string& heading) {
    const std::size_t begin = text.find("\n" + heading + "\n");
    REQUIRE(begin != std::string::npos);
    return text.substr(begin, text.find("\n## ", begin + 1) - begin);
}

}  // namespace

TEST_CASE("The published table of speeds has the rows that stymo-bench measures, and no others") {
    const std::string page = stymo::read_file(fs::path(STYMO_SOURCE_DIR) / "docs/results.md");
    const std::string speed = section(page, "## Speed");
    std::set<std::string> unknown = names_in_table(speed);
    for (const json& row : rows_listed()) {
        const auto name = row["name"].get<std::string>();
        unknown.erase(name);
        // Rows that are not measured yet stand below the table.
        CHECK_THAT(speed, Catch::Contains("`" + name + "`"));
    }
    CHECK(unknown.empty());
}

TEST_CASE(
    "A command of stymo-bench gives each of its rows with time, memory and share of the peak") {
    const json result = json::parse(done("stymo-bench edit --json" + small).out);
    REQUIRE(result["rows"].size() == 2);
    for (const json& row : result["rows"]) {
        CHECK(row["median_seconds"].get<double>() >= row["minimum_seconds"].get<double>());
        CHECK(row["minimum_seconds"].get<double>() > 0.0);
        CHECK(row["peak_memory_mebibytes"].get<double>() > 1.0);
        CHECK(row["share_of_peak"].get<double>() > 0.0);
        CHECK(row["times_peer"].is_null());
    }
    CHECK(result["peak"]["float32_flops"].get<double>() > 1e8);
}

TEST_CASE("Frames that leave out work come with their error") {
    const json row = json::parse(done("stymo-bench row skip-frame --json" + small).out);
    CHECK(row["name"] == "skip-frame");
    const bool equal = row["equal_images"].get<bool>();
    CHECK((equal || row["psnr_worst_db"].get<double>() > 5.0));
}

TEST_CASE("Steps of fitting are measured on the photos of a folder") {
    const json row =
        json::parse(done("stymo-bench row fit-step-photometric --json --data faces" + small).out);
    CHECK(row["median_seconds"].get<double>() > 0.0);
}

TEST_CASE("The curve is written as JSON, CSV and Markdown") {
    done("stymo-bench curve --out bench" + small);
    const fs::path folder = tiny_run() / "bench";
    const json curve = json::parse(stymo::read_file(folder / "curve.json"));
    const auto points = static_cast<std::ptrdiff_t>(curve["curve"].size());
    CHECK(stymo::line_count(stymo::read_file(folder / "curve_curve.csv")) == points + 1);
    CHECK(names_in_table(stymo::read_file(folder / "curve.md")).empty());
}

TEST_CASE("The gain by more processors is predicted for each job, plausibly", "[slow]") {
    done("stymo-bench cores --out cores" + small);
    const json table = json::parse(stymo::read_file(tiny_run() / "cores/cores.json"))["cores"];
    REQUIRE(table.size() == 6);
    for (const json& row : table) {
        CAPTURE(row["job"].get<std::string>());
        double before = 1.0;
        for (const auto& [column, threads] : {std::pair{"two_predicted", 2.0},
                                              {"four_predicted", 4.0},
                                              {"sixteen_predicted", 16.0},
                                              {"sixty_four_predicted", 64.0}}) {
            const double gain = row[column];
            // Chunks are measured anew for each number of threads, on a machine that may be busy.
            CHECK(gain > 0.5 * before);
            CHECK(gain < 2.0 * threads);
            before = gain;
        }
        CHECK(row["span_seconds"] > 0.0);
        CHECK(row["one_measured_by_predicted"] > 0.2);
        CHECK(row["span_seconds"] < 1.01 * row["work_seconds"].get<double>());
        CHECK_FALSE(row["caps_at_sixteen"].get<std::string>().empty());
    }
}

TEST_CASE("A peer stands beside the rows that it has, and one that fails is named", "[slow]") {
    stymo::write_file(tiny_run() / "peer.py", "print('disc: 1500.0 ms  (threads 1)')\n");
    stymo::write_file(tiny_run() / "broken.py", "raise SystemExit('no memory')\n");
    const bool torch =
        stymo::run_child({"/usr/bin/python3", "-c", "import torch, torchvision"}).exit_code == 0;
    const ToolOutcome outcome = run_tool(tiny_run(), "stymo-bench render --peer none.py" + small);
    CHECK(outcome.exit_code == 1);
    CHECK(
        outcome.err ==
        "stymo-bench: none.py: no such file; --peer names scripts/torch_peer.py of the project\n");
    const ToolOutcome other =
        run_tool(tiny_run(), "stymo-bench render --peer peer.py --peer-python ./none" + small);
    CHECK_THAT(other.err, Catch::Contains("no peer: ./none has no PyTorch"));
    if (!torch) {
        WARN("skipped: no PyTorch");
        return;
    }
    const ToolOutcome broken = run_tool(tiny_run(), "stymo-bench render --peer broken.py" + small);
    CHECK(broken.exit_code == 1);
    CHECK_THAT(broken.err,
               Catch::Contains("stymo-bench: broken.py: render was not measured: no memory"));
}

TEST_CASE("stymo-bench says in one line what it cannot measure") {
    const auto refused = [](const std::string& command, int exit_code, const std::string& culprit) {
        const ToolOutcome outcome = run_tool(tiny_run(), command);
        INFO(command << "\n" << outcome.err);
        CHECK(outcome.exit_code == exit_code);
        CHECK(outcome.out.empty());
        CHECK(stymo::line_count(outcome.err) == 1);
        CHECK_THAT(outcome.err, Catch::StartsWith("stymo-bench: ") && Catch::Contains(culprit));
    };
    refused("stymo-bench", 2, "a command is required");
    refused("stymo-bench row hop", 2, "hop");
    refused("stymo-bench render --repeats 0", 2, "--repeats");
    refused("stymo-bench render --model none", 1, "none: ");
    refused("stymo-bench render --data none" + small, 1, "none: ");
    refused("stymo-bench edit --out file" + small, 1, "file");
}
