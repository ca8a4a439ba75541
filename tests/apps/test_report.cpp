// The page that stymo-bench report writes, and what the command refuses.
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

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
    page.title(1, "Title");
    page.add({.name = "rows",
              .columns = {{"what", "what"},
                          {"seconds", "ms", stymo::milliseconds},
                          {"count"},
                          {"x", "|x|"}},
              .rows = {{"a, \"b\"", 1.0 / 3e2, std::int64_t{7}, "1 | 2"},
                       {"µ", {}, std::int64_t{8}, true}}});
    static_cast<void>(page.finish());
    CHECK(read_file(folder / "speed_rows.csv") ==
          "what,seconds,count,x\n\"a, \"\"b\"\"\",0.0033333333333333335,7,1 | 2\nµ,,8,true\n");
    const json rows = json::parse(read_file(folder / "speed.json"))["rows"];
    CHECK(rows ==
          json::parse(R"([{"what":"a, \"b\"","seconds":0.0033333333333333335,"count":7,"x":"1 | 2"},
                                  {"what":"µ","seconds":null,"count":8,"x":true}])"));
    CHECK(read_file(folder / "speed.md") ==
          "# Title\n\n"
          "| what   | ms   | \\|x\\|  |\n|--------|------|--------|\n| a, \"b\" | 3.33 | 1 \\| 2 "
          "|\n| "
          "µ      "
          "|      | yes    |\n\n"
          "Numbers: [speed_rows.csv](speed_rows.csv)\n");
}

TEST_CASE("A row is read back from its JSON", "[report]") {
    const std::vector<stymo::Column> columns{{"a"}, {"b"}, {"c"}, {"d"}, {"missing"}};
    const stymo::Row row{"words", 0.5, std::int64_t{3}, true, {}};
    CHECK(stymo::row_from_json(columns, stymo::to_json(columns, row).text()) == row);
    CHECK_THROWS_AS(stymo::row_from_json(columns, "[]"), stymo::Error);
}

TEST_CASE("A plot has a series for each value of a column, without what a scale cannot show",
          "[report]") {
    const stymo::Table table{.name = "t",
                             .columns = {{"way"}, {"seconds"}, {"error"}},
                             .rows = {{"a", 0.001, 1.0}, {"b", 0.002, 2.0}, {"a", 0.003, 0.0}}};
    const stymo::Plot plot =
        stymo::plot_of(table, {.series = "way", .x = "seconds", .y = "error", .x_unit = 1e-3},
                       {.title = "t", .x_label = "ms", .y_label = "error", .series = {}});
    REQUIRE(plot.series.size() == 2);
    CHECK(plot.series[0].name == "a");
    REQUIRE(plot.series[0].points.size() == 1);
    CHECK(plot.series[0].points[0].x == Approx(1.0));
    CHECK_THROWS_AS(table.number(table.rows[0], "none"), stymo::ValueError);
}

TEST_CASE("A page has no two files of one name and no ragged table", "[report]") {
    const fs::path folder = new_folder("report-names");
    Page page("report", folder);
    page.add({.name = "numbers", .columns = {{"x"}}, .rows = {{std::int64_t{1}}}});
    CHECK_THROWS_AS(
        page.plot("numbers",
                  {.title = "t", .x_label = "x", .y_label = "y", .series = {{"s", {{1.0, 1.0}}}}}),
        stymo::ValueError);
    CHECK_THROWS_AS(page.add({.name = "others", .columns = {{"x"}, {"y"}}, .rows = {{true}}}),
                    stymo::ValueError);
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
    refused("stymo-bench report --out no-report --parts quadrature,soup", 2, "soup");
    refused("stymo-bench report --out no-report --parts ,", 2, "--parts");
    refused("stymo-bench report --out file --parts quadrature", 1, "file");
    for (const stymo::Study& study : stymo::report_studies())
        if (study.needs_model) {
            refused("stymo-bench report --out no-report --model run/model.safetensors --parts " +
                        study.name,
                    2, "--data");
            refused("stymo-bench report --out no-report --model none --data faces --parts " +
                        study.name,
                    1, "none: ");
        }
}

TEST_CASE("The report on quadrature has its page, plots and numbers", "[report][slow]") {
    const auto outcome = run_tool(
        tiny_run(), "stymo-bench report --out quadrature --parts quadrature --repeats 1 --json");
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    CHECK(json::parse(outcome.out)["parts"][0]["name"] == "quadrature");
    const fs::path folder = tiny_run() / "quadrature";
    const std::string page = read_file(folder / "report.md");
    for (const auto& entry : fs::directory_iterator(folder))
        if (!entry.path().filename().string().starts_with("report."))
            CHECK_THAT(page, Catch::Contains("(" + entry.path().filename().string() + ")"));
    for (const json& row : json::parse(read_file(folder / "report.json"))["quadrature"]) {
        if (row["rule"] != "Euler" && row["samples"] == 4096)
            CHECK(row["colour_error"].get<double>() < 2e-3);
    }
}
