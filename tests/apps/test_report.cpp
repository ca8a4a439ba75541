// The page that stymo-bench report writes, and what the command refuses.
#include <catch2/catch.hpp>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/bench/study.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/error.h"
#include "core/io/file.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::Page;
using stymo::read_file;
using stymo::run_tool;
using stymo::tiny_run;

fs::path new_folder(const std::string& name) {
    const fs::path folder = tiny_run() / name;
    fs::remove_all(folder);
    fs::create_directories(folder);
    return folder;
}

}  // namespace

TEST_CASE("A table of a page is Markdown for people, CSV and JSON for programs", "[report]") {
    const fs::path folder = new_folder("report-table");
    Page page("speed", folder);
    page.text("# Title");
    page.add(
        {"rows",
         {"what", "median_seconds", "~count", "|x|"},
         {{"a, \"b\"", 1.0 / 3e2, std::int64_t{7}, "1 | 2"}, {"µ", {}, std::int64_t{8}, true}}});
    static_cast<void>(page.finish());
    CHECK(read_file(folder / "speed_rows.csv") ==
          "what,median_seconds,count,|x|\n\"a, \"\"b\"\"\",0.0033333333333333335,7,1 | 2\n"
          "µ,,8,true\n");
    const json rows = json::parse(read_file(folder / "speed.json"))["rows"];
    CHECK(rows == json::parse(R"([
        {"what": "a, \"b\"", "median_seconds": 0.0033333333333333335, "count": 7, "|x|": "1 | 2"},
        {"what": "µ", "median_seconds": null, "count": 8, "|x|": true}])"));
    CHECK(read_file(folder / "speed.md") ==
          "# Title\n\n"
          "| what   | median   | \\|x\\|  |\n"
          "|--------|----------|--------|\n"
          "| a, \"b\" | 3.333 ms | 1 \\| 2 |\n"
          "| µ      |          | yes    |\n\n"
          "Numbers: [speed_rows.csv](speed_rows.csv)\n");
}

TEST_CASE("The key of a column says in which unit people read it", "[report]") {
    const stymo::Table table{
        "t", {"seconds", "seconds_exact", "psnr_db", "peak_bytes", "share_of_peak", "n", "error"}};
    const stymo::Row row{2.5,
                         0.00025,
                         std::numeric_limits<double>::infinity(),
                         std::int64_t{3} << 20,
                         0.456,
                         std::int64_t{65536},
                         1.23456e-7};
    const auto shown = [&](const char* key) { return stymo::words(table, row, key); };
    CHECK(shown("seconds") == "2.5 s");
    CHECK(shown("seconds_exact") == "0.25 ms");
    CHECK(shown("psnr_db") == "equal");
    CHECK(shown("peak_bytes") == "3.0 MiB");
    CHECK(shown("share_of_peak") == "46 %");
    CHECK(shown("n") == "65536");
    CHECK(shown("error") == "1.235e-07");
    CHECK(stymo::number(table, row, "n") == 65536.0);
    CHECK_THROWS_AS(stymo::number(table, row, "none"), stymo::ValueError);
}

TEST_CASE("A row is read back from its JSON", "[report]") {
    const std::vector<stymo::Column> columns{"a", "b", "c", "d", "missing"};
    const stymo::Row row{"words", 0.5, std::int64_t{3}, true, {}};
    CHECK(stymo::row_from_json(columns, stymo::to_json(columns, row).text()) == row);
    CHECK_THROWS_AS(stymo::row_from_json(columns, "[]"), stymo::Error);
}

TEST_CASE("A study becomes its rows, its summary and its curves", "[report]") {
    const fs::path folder = new_folder("report-study");
    Page page("report", folder);
    stymo::Study study{.part = "part",
                       .name = "squares",
                       .title = "Squares",
                       .varied = "x",
                       .measured = "its square",
                       .reference = "none",
                       .columns = {"x", "square"},
                       .plan = {}};
    study.plan = [](const stymo::StudyInputs& inputs) {
        stymo::StudyPlan plan;
        plan.curves = std::make_shared<stymo::Table>(stymo::Table{"points", {"x"}});
        for (const double x : {2.0, inputs.seconds})
            plan.add({x}, [x, curves = plan.curves]() -> stymo::Row {
                curves->rows.push_back({x});
                return {x * x};
            });
        return plan;
    };
    study.summary = [](const stymo::Table& table) {
        return stymo::Table{"last", {"square"}, {stymo::Row{table.rows.back()[1]}}};
    };
    stymo::run_study(page, study, {.bench = {}, .seconds = 3.0});
    const json result = json::parse(page.finish().json.text());
    CHECK(result["squares"] == json::parse(R"([{"x": 2, "square": 4}, {"x": 3, "square": 9}])"));
    CHECK(result["last"] == json::parse(R"([{"square": 9}])"));
    CHECK(result["points"] == json::parse(R"([{"x": 2}, {"x": 3}])"));
    const std::string text = read_file(folder / "report.md");
    CHECK_THAT(text, Catch::Contains("## Squares\n\nVaried: x. Measured: its square. ") &&
                         Catch::Contains("| 9      |\n\nNumbers: [report_last.csv]") &&
                         !Catch::Contains("| x   |\n|-----|\n"));
    CHECK(read_file(folder / "report_points.csv") == "x\n2\n3\n");
}

TEST_CASE("No two tables of the report have one name, and no table is ragged", "[report]") {
    std::set<std::string> names;
    for (const stymo::Study& study : stymo::report_studies())
        CHECK(names.insert(study.name).second);
    const fs::path folder = new_folder("report-ragged");
    Page page("report", folder);
    CHECK_THROWS_AS(page.add({"others", {"x", "y"}, {stymo::Row{true}}}), stymo::ValueError);
    CHECK_FALSE(fs::exists(folder / "report_others.csv"));
}

TEST_CASE(
    "A part of the report that does not exist, or lacks its model, is refused before anything is "
    "written",
    "[report]") {
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
    refused("stymo-bench report --out no-report --parts training,soup", 2, "soup");
    refused("stymo-bench report --out no-report --parts ,", 2, "--parts");
    refused("stymo-bench report --out file --parts training", 1, "file");
    for (const stymo::Study& study : stymo::report_studies())
        if (study.needs_model) {
            refused("stymo-bench report --out no-report --model run/model.safetensors --parts " +
                        study.part,
                    2, "--data");
            refused("stymo-bench report --out no-report --model none --data faces --parts " +
                        study.part,
                    1, "none: ");
        }
}

TEST_CASE("The report on rendering has its page and numbers", "[report][slow]") {
    const auto outcome =
        run_tool(tiny_run(),
                 "stymo-bench report --out rendering --parts rendering --repeats 1 --faces 1 "
                 "--views 2 --samples 4 --model run/model.safetensors --data faces --json");
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    CHECK(json::parse(outcome.out)["parts"][0]["name"] == "rendering");
    const fs::path folder = tiny_run() / "rendering";
    const std::string page = read_file(folder / "report.md");
    for (const auto& entry : fs::directory_iterator(folder))
        if (!entry.path().filename().string().starts_with("report."))
            CHECK_THAT(page, Catch::Contains("(" + entry.path().filename().string() + ")"));
    CHECK_FALSE(json::parse(read_file(folder / "report.json"))["curve"].empty());
}
