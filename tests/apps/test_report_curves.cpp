// The sections of the report on rendering, fitting and training: what they compute, and their pages on the smallest model.
#include <catch2/catch.hpp>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/bench/report/fitting.h"
#include "apps/bench/report/rendering.h"
#include "apps/bench/report/section.h"
#include "apps/bench/report/small_model.h"
#include "apps/bench/report/training.h"
#include "apps/tiny_run.h"
#include "core/io/file.h"

using namespace stymo;

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// A section on the smallest model within a second or two, as its folder.
fs::path written(const ReportSection& section, double seconds) {
    const fs::path folder = tiny_run() / ("report-" + section.name);
    fs::remove_all(folder);
    fs::create_directories(folder);
    const BenchOptions bench{.model = tiny_run() / "run/model.safetensors",
                             .data = tiny_run() / "faces",
                             .repeats = 1,
                             .faces = 1,
                             .views = 2,
                             .samples = 4};
    LpipsOptions lpips;
    lpips.trunk = lpips.heads = "random";
    ReportWriter report(folder);
    section.write(report, {.bench = bench, .fitting = bench, .lpips = lpips, .seconds = seconds});
    report.finish();
    return folder;
}

json rows_of(const fs::path& file) {
    return json::parse(read_text_file(file));
}

}  // namespace

TEST_CASE("The small model of the report is that of demo-64.json", "[report]") {
    TrainConfig demo = load_train_config(fs::path(STYMO_SOURCE_DIR) / "configs/demo-64.json", {});
    demo.stage1.average_half_life = 0.0;
    CHECK(to_json(small_training(demo.stage1.steps, demo.stage1.samples_per_ray)) == to_json(demo));
}

TEST_CASE("When a fit reached a loss is found among its points", "[report]") {
    const std::vector<FitPoint> points{{0, 0.0, 5.0, 10.0}, {1, 0.5, 3.0, 12.0}, {2, 1.0, 4.0, 13.0}, {3, 1.5, 1.0, 14.0}};
    REQUIRE(first_reaching(points, 3.5) != nullptr);
    CHECK(first_reaching(points, 3.5)->steps == 1);
    CHECK(first_reaching(points, 1.0)->steps == 3);
    CHECK(first_reaching(points, 0.5) == nullptr);
    CHECK(point_at(points, 0.7).steps == 1);
    CHECK(point_at(points, 1.0).steps == 2);
    CHECK(point_at(points, 99.0).steps == 3);
    CHECK(point_at(points, -1.0).steps == 0);
}

TEST_CASE("The section on rendering holds every frame against the exact one", "[report]") {
    const fs::path folder = written(rendering_section(), 1.0);
    const json rows = rows_of(folder / "rendering.json");
    REQUIRE(rows.size() > 10);
    CHECK(rows[0]["varied"] == "exact");
    CHECK(rows[0]["worst pixel"] == 0.0);
    for (const json& row : rows) {
        const bool equal = row["PSNR dB"].is_null();
        CHECK(equal == (row["worst pixel"] == 0.0));
        if (!equal) CHECK(row["PSNR dB"].get<double>() >= row["worst picture's"].get<double>() - 1e-9);
    }
    for (const json& row : rows_of(folder / "rendering_fastest.json"))
        if (!row["worst picture's"].is_null()) CHECK(row["worst picture's"].get<double>() >= row["wanted dB"].get<double>());
}

TEST_CASE("The section on fitting judges every way by the same loss", "[report]") {
    const fs::path folder = written(fitting_section(), 1.0);
    const json rows = rows_of(folder / "fitting.json");
    REQUIRE(rows.size() == 7);
    CHECK(rows[0]["times sooner"].get<double>() >= 1.0);
    std::map<std::string, double> first;
    for (const json& point : rows_of(folder / "fitting_curves.json"))
        if (point["steps"] == 0) first[point["way"].get<std::string>()] = point["loss"].get<double>();
    REQUIRE(first.size() == rows.size());
    for (const auto& [way, loss] : first) CHECK(loss == Approx(first.begin()->second));
}

TEST_CASE("The section on training lowers the loss with every number of samples", "[report][slow]") {
    const fs::path folder = written(training_section(), 4.0);
    std::map<int, std::vector<double>> losses;
    for (const json& point : rows_of(folder / "training_curves.json"))
        losses[point["samples"].get<int>()].push_back(point["reconstruction_loss"].get<double>());
    REQUIRE(losses.size() == 3);
    for (const auto& [samples, curve] : losses) {
        INFO(samples);
        CHECK(curve.back() < curve.front());
    }
    CHECK_THAT(read_text_file(folder / "report.md"), Catch::Contains("training in 16 bits does not exist"));
}
