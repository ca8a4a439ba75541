// The page that stymo-bench report writes, and what the command refuses.
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/bench/report/section.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/error.h"
#include "core/io/file.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::read_text_file;
using stymo::ReportWriter;
using stymo::run_tool;
using stymo::tiny_run;

fs::path new_folder(const std::string& name) {
    const fs::path folder = tiny_run() / name;
    fs::remove_all(folder);
    fs::create_directories(folder);
    return folder;
}

}  // namespace

TEST_CASE("A table of a report is Markdown for people, CSV and JSON for programs", "[report]") {
    const fs::path folder = new_folder("report-table");
    ReportWriter report(folder);
    report.title(1, "Title");
    report.table("speeds", {"what", "µs", "count"}, {{"a, \"b\"", 1.0 / 3.0, 7}, {"µ", {"many", stymo::JsonValue()}, 8}});
    report.finish();
    CHECK(read_text_file(folder / "speeds.csv") == "what,µs,count\n\"a, \"\"b\"\"\",0.3333333333333333,7\nµ,null,8\n");
    const json rows = json::parse(read_text_file(folder / "speeds.json"));
    CHECK(rows == json::parse(R"([{"what":"a, \"b\"","µs":0.3333333333333333,"count":7},{"what":"µ","µs":null,"count":8}])"));
    CHECK(read_text_file(folder / "report.md") ==
          "# Title\n\n"
          "| what   | µs    | count |\n|--------|-------|-------|\n| a, \"b\" | 0.333 | 7     |\n| µ      | many  | 8     |\n\n"
          "Numbers: [speeds.csv](speeds.csv), [speeds.json](speeds.json)\n");
}

TEST_CASE("A report has no two files of one name and no ragged table", "[report]") {
    const fs::path folder = new_folder("report-names");
    ReportWriter report(folder);
    report.data("numbers", {"x"}, {{1}});
    CHECK_THROWS_AS(report.plot("numbers", {.title = "t", .x_label = "x", .y_label = "y", .series = {{"s", {{1.0, 1.0}}}}}),
                    stymo::ValueError);
    CHECK_THROWS_AS(report.table("others", {"x", "y"}, {{1}}), stymo::ValueError);
    CHECK_FALSE(fs::exists(folder / "others.csv"));
}

TEST_CASE("A part of the report that does not exist, or lacks its model, is refused before anything is written", "[report]") {
    const auto refused = [](const std::string& command, int exit_code, const std::string& culprit) {
        const auto outcome = run_tool(tiny_run(), command);
        INFO(command << "\n" << outcome.err);
        CHECK(outcome.exit_code == exit_code);
        CHECK(outcome.out.empty());
        CHECK(stymo::line_count(outcome.err) == 1);
        CHECK_THAT(outcome.err, Catch::StartsWith("stymo-bench: ") && Catch::Contains(culprit));
        CHECK_FALSE(fs::exists(tiny_run() / "no-report"));
    };
    refused("stymo-bench report", 2, "--out");
    refused("stymo-bench report --out no-report --parts quadrature,soup", 2, "soup");
    refused("stymo-bench report --out no-report --parts ,", 2, "--parts");
    refused("stymo-bench report --out file --parts quadrature", 1, "file");
    for (const stymo::ReportSection& section : stymo::report_sections())
        if (section.needs_model) {
            refused("stymo-bench report --out no-report --model run/model.safetensors --parts " + section.name, 2, "--data");
            refused("stymo-bench report --out no-report --model none --data faces --parts " + section.name, 1, "none: ");
        }
}

TEST_CASE("The report on quadrature has its page, plots and numbers", "[report][slow]") {
    const auto outcome = run_tool(tiny_run(), "stymo-bench report --out quadrature --parts quadrature --repeats 1 --json");
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    CHECK(json::parse(outcome.out)["parts"][0]["name"] == "quadrature");
    const fs::path folder = tiny_run() / "quadrature";
    const std::string page = read_text_file(folder / "report.md");
    for (const auto& entry : fs::directory_iterator(folder))
        if (entry.path().filename() != "report.md")
            CHECK_THAT(page, Catch::Contains("(" + entry.path().filename().string() + ")"));
    for (const json& row : json::parse(read_text_file(folder / "quadrature.json"))) {
        const bool approximates = row["rule"] != "Euler" && row["profile"] != "shell";
        if (approximates && row["samples"] == 4096) CHECK(row["colour_error"].get<double>() < 2e-3);
    }
}
