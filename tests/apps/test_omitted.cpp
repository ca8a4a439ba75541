// What scenes and jobs leave out, on the smallest model: less work, the same result.
#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/bench/report/omitted.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "support/check_close.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

ModelConfig small_config() {
    ModelConfig config = tiny_model_config();
    config.decoder.rays.rays_per_side = 32;
    config.decoder.resolution = 64;
    config.decoder.depth_planes = "optical_axis";
    return config;
}

BenchOptions small_options() {
    return {.repeats = 1, .faces = 1, .views = 2, .samples = 4};
}

double greatest(const Tensor& values) {
    double most = 0.0;
    for (const double value : values.to_vector()) most = std::max(most, std::abs(value));
    return most;
}

}  // namespace

TEST_CASE("Every scene is rendered by both modes, and an empty one needs nothing", "[omitted]") {
    BenchSubject subject = random_subject(small_config(), small_options(), 1);
    for (const Scene& scene : omitted_scenes(subject.model)) {
        INFO(scene.name);
        if (scene.empty) empty_field(subject.model);
        const SceneFrames all = scene_frames(subject.model, subject.codes, scene, RenderMode::exact, 4, 1);
        const SceneFrames needed = scene_frames(subject.model, subject.codes, scene, RenderMode::skip, 4, 1);
        CHECK(all.counts.field_samples == 4 * 1024);
        CHECK(needed.counts.field_samples <= all.counts.field_samples);
        CHECK(needed.work.buffers == 0);
        if (!scene.empty) continue;
        CHECK(needed.counts.field_samples == 0);
        CHECK(needed.counts.layers_computed == 0);
        CHECK(needed.work.field_points == 0);
        CHECK(check_close(needed.picture, all.picture, 1e-4).passed);
    }
}

TEST_CASE("A job with what it needs gives what it gives with everything, for less work", "[omitted]") {
    BenchSubject subject = random_subject(small_config(), small_options(), 1);
    const std::vector<OmittedJob> jobs = omitted_jobs(subject, small_options(), 1);
    REQUIRE(jobs.size() == 5);
    for (const OmittedJob& job : jobs) {
        INFO(job.name);
        const JobRun needed = run_job(job.needed, job.before, 0), everything = run_job(job.everything, {}, 0);
        CHECK(check_close(needed.result, everything.result, 1e-4 * greatest(everything.result)).passed);
        CHECK(needed.work.operations < everything.work.operations);
        CHECK(needed.work.buffers < everything.work.buffers);
        CHECK(needed.work.field_points <= everything.work.field_points);
        CHECK(needed.work.parameters <= everything.work.parameters);
        CHECK(subject.model.parameters().trainable().empty());
        if (job.name.starts_with("edit")) CHECK(needed.work.field_points == 0);
        if (job.name.starts_with("evaluation")) CHECK(needed.work.gradient_rules == 0);
    }
}

TEST_CASE("The report has a row for each scene and two for each job, with the counts of what was done", "[report][slow]") {
    const auto outcome = run_tool(tiny_run(),
                                  "stymo-bench report --out omitted --parts omitted --repeats 1 --samples 4 --model "
                                  "run/model.safetensors --data faces");
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    const std::filesystem::path folder = tiny_run() / "omitted";
    const nlohmann::json scenes = nlohmann::json::parse(read_text_file(folder / "omitted_scenes.json"));
    REQUIRE(scenes.size() == 5);
    CHECK(scenes[4]["scene"] == "empty");
    CHECK(scenes[4]["through the field"] == 0);
    const nlohmann::json jobs = nlohmann::json::parse(read_text_file(folder / "omitted_jobs.json"));
    REQUIRE(jobs.size() == 10);
    for (std::size_t i = 0; i < jobs.size(); i += 2) {
        CHECK(jobs[i]["error"].get<double>() < 1e-4);
        CHECK(jobs[i]["operations"] < jobs[i + 1]["operations"]);
    }
}
