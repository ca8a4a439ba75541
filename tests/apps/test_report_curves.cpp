// The studies of rendering, fitting and training: what they compute, and their pages
// on the smallest model.
#include <catch2/catch.hpp>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/bench/study.h"
#include "apps/tiny_run.h"
#include "apps/weights/derived_models.h"
#include "core/io/file.h"
#include "core/matmul_precision.h"

using namespace stymo;

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// What a study finds on the smallest model within a second or two: report.json.
json written(const Study& study, double seconds,
             const fs::path& model = tiny_run() / "run/model.safetensors") {
    const fs::path folder = tiny_run() / ("report-" + study.name);
    fs::remove_all(folder);
    fs::create_directories(folder);
    const BenchOptions bench{.model = model,
                             .data = tiny_run() / "faces",
                             .repeats = 1,
                             .faces = 1,
                             .views = 2,
                             .samples = 4};
    LpipsOptions lpips;
    lpips.trunk = lpips.heads = "random";
    Page page("report", folder);
    run_study(page, study, {.bench = bench, .fitting = bench, .lpips = lpips, .seconds = seconds});
    static_cast<void>(page.finish());
    return json::parse(read_file(folder / "report.json"));
}

}  // namespace

/// Precisions of products that this processor has, without float32.
std::size_t lowered_precisions() {
    std::size_t count = 0;
    for (const auto precision : {MatmulPrecision::high, MatmulPrecision::medium})
        if (computed_precision(precision) == precision) ++count;
    return count;
}

TEST_CASE("The small model of the report is that of demo-64.json", "[report]") {
    TrainConfig demo = load_train_config(fs::path(STYMO_SOURCE_DIR) / "configs/demo-64.json", {});
    demo.stage1.average_half_life = 0.0;
    CHECK(to_json(small_training(demo.stage1.steps, demo.stage1.samples_per_ray)) == to_json(demo));
}

TEST_CASE("The study of rendering holds every frame against the exact one", "[report]") {
    const json report = written(rendering_study(), 1.0);
    const json rows = report["curve"];
    REQUIRE(rows.size() == 9 + lowered_precisions());
    CHECK(rows[0]["varied"] == "exact");
    CHECK(rows[0]["worst_pixel"] == 0.0);
    for (const json& row : rows) {
        CHECK(row["psnr_worst_db"].is_null() == (row["worst_pixel"] == 0.0));
        // Infinite where one of the images is equal.
        if (!row["psnr_mean_db"].is_null())
            CHECK(row["psnr_mean_db"].get<double>() >= row["psnr_worst_db"].get<double>() - 1e-9);
    }
    for (const json& row : report["fastest"])
        if (!row["psnr_worst_db"].is_null())
            CHECK(row["psnr_worst_db"].get<double>() >= row["wanted_db"].get<double>());
}

TEST_CASE("The study of fitting judges every way by the same loss", "[report][slow]") {
    const json report = written(fitting_study(), 6.0);
    const json rows = report["fitting"];
    REQUIRE(rows.size() == 10 + lowered_precisions());
    // Nothing where no face gets there in the time, on a slow or busy machine.
    if (!rows[0]["times_sooner"].is_null()) CHECK(rows[0]["times_sooner"].get<double>() >= 1.0);
    std::map<std::string, double> first;
    for (const json& point : report["fitting_curves"])
        if (point["steps"] == 0)
            first[point["way"].get<std::string>()] = point["loss"].get<double>();
    REQUIRE(first.size() == rows.size());
    for (const auto& [way, loss] : first) CHECK(loss == Approx(first.begin()->second));
}

TEST_CASE("The study of training lowers the loss with every number of samples", "[report][slow]") {
    const json report = written(training_study(), 4.0);
    std::map<int, std::vector<double>> losses;
    for (const json& point : report["training_curves"])
        losses[point["samples"].get<int>()].push_back(point["reconstruction_loss"].get<double>());
    REQUIRE(losses.size() == 3);
    for (const auto& [samples, curve] : losses) {
        INFO(samples);
        CHECK(curve.back() < curve.front());
    }
}

TEST_CASE("The study of tuning begins with the untuned face", "[report][slow]") {
    const json rows = written(tuning_study(), 2.5)["tuning"];
    REQUIRE(rows.size() == 2);
    CHECK(rows[0]["steps"] == 0);
    CHECK(rows[0]["psnr_turned_db"].is_null());
    CHECK(rows[1]["steps"].get<int>() > 0);
    CHECK(rows[1]["psnr_turned_db"].get<double>() > 0.0);
}

TEST_CASE("The studies of fitting and tuning take models that correct their codes",
          "[report][slow]") {
    const fs::path correcting = tiny_run() / "correcting.safetensors";
    widen_model(tiny_run() / "run/model.safetensors", correcting,
                std::vector<std::string>{"encoder.corrections=1"});
    CHECK(written(tuning_study(), 2.5, correcting)["tuning"].size() == 2);
    CHECK(written(fitting_study(), 2.0, correcting)["fitting"].size() == 10 + lowered_precisions());
}

TEST_CASE("The study of training steps gives each way the same seeds", "[report][slow]") {
    const json rows = written(step_study(), 4.0)["training_steps"];
    REQUIRE(rows.size() == 2 + 2 * lowered_precisions());
    for (const json& row : rows) {
        CHECK(row["steps"] == rows[0]["steps"]);
        CHECK(row["psnr_least_db"].get<double>() <= row["psnr_db"].get<double>());
        CHECK(row["psnr_most_db"].get<double>() >= row["psnr_db"].get<double>());
        CHECK(row["psnr_db"].get<double>() == Approx(rows[0]["psnr_db"].get<double>()).margin(1.0));
    }
}
