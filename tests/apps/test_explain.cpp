// --explain: which networks were made and what was counted, on stderr and in the JSON object.
#include <algorithm>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "apps/tiny_run.h"
#include "apps/tool_run.h"

namespace {

using nlohmann::json;
using stymo::ToolOutcome;

ToolOutcome explained(const std::string& command) {
    ToolOutcome outcome = stymo::run_tool(stymo::tiny_run(), command + " --explain --json");
    INFO(command << "\n" << outcome.err);
    REQUIRE(outcome.exit_code == 0);
    CHECK_THAT(outcome.err, Catch::Contains("networks made") && Catch::Contains("counts\n"));
    return outcome;
}

json explanation(const std::string& command) {
    return json::parse(explained(command).out)["explain"];
}

bool made(const json& explain, const std::string& network) {
    return explain["networks"].contains(network);
}

const std::string render =
    "stymo-render --model run/model.safetensors --codes fit/codes.json --out explained.png ";
const std::string fit =
    "stymo-fit --model run/model.safetensors --data faces --id 00011 --out explained-fit ";
const std::string train = "stymo-train --config tiny.json --data faces ";

}  // namespace

TEST_CASE(
    "Rendering makes neither encoder nor gradients, and computes the mask only if it is wanted",
    "[explain]") {
    const json plain = explanation(render + "--mode exact --samples 4 --raw"),
               masked = explanation(render + "--mode exact --samples 4 --raw --mask");
    CHECK_FALSE(made(plain, "encoder"));
    CHECK_FALSE(made(plain, "discriminator"));
    CHECK_FALSE(made(plain, "lpips"));
    const json& counts = plain["counts"];
    CHECK(plain["loss_terms"].empty());
    CHECK(counts["gradient_rules"] == 0);
    CHECK(counts["gradients"] == 0);
    CHECK(counts["samples_of_the_last_frame"] == 4 * 1024);
    CHECK(counts["through_the_field"] == 4 * 1024);
    CHECK(counts["field_points"] == 4 * 1024);
    CHECK(counts["tiles"] > 0);
    CHECK(counts["pixels_computed"] == 64 * 64);
    CHECK(counts["peak_bytes"] > 0);
    // Of the tiny model's one render block: a lateral, and the layer that joins them.
    CHECK(counts["layers_computed"].get<int>() + 2 ==
          masked["counts"]["layers_computed"].get<int>());
    CHECK(counts["layers"] == masked["counts"]["layers"]);
    CHECK(counts["operations"] < masked["counts"]["operations"]);
    CHECK(counts["parameters_made"] == masked["counts"]["parameters_made"]);
}

TEST_CASE("A fit makes LPIPS only for its weight or for a metric, and has gradients of codes alone",
          "[explain]") {
    const json without = explanation(fit + "--steps 2");
    CHECK(made(without, "encoder"));
    CHECK_FALSE(made(without, "lpips"));
    CHECK(without["counts"]["steps"] == 2);
    CHECK(without["loss_terms"].contains("photometric"));
    CHECK(without["loss_terms"].contains("regularizer"));
    CHECK_FALSE(without["loss_terms"].contains("perceptual"));
    CHECK(without["counts"]["gradients"] == 2 * 4);
    CHECK_FALSE(without["counts"].contains("tuning_steps"));
    CHECK(explanation(fit + "--steps 2 --tune-steps 3")["counts"]["tuning_steps"] == 3);

    const json with = explanation(
        fit + "--steps 2 --perceptual-weight 0.1 --lpips-trunk random --lpips-heads random");
    CHECK(made(with, "lpips"));
    CHECK(with["loss_terms"].contains("perceptual"));
    CHECK(without["counts"]["parameters_made"] < with["counts"]["parameters_made"]);
    CHECK(without["counts"]["gradient_rules"] < with["counts"]["gradient_rules"]);
    CHECK(without["counts"]["peak_bytes"] < with["counts"]["peak_bytes"]);
}

TEST_CASE("Points of grids are counted, in every tool that evaluates them", "[explain]") {
    const json counts = explanation(render + "--samples 4 --tolerance 0.1")["counts"];
    CHECK(counts["field_points"] > counts["through_the_field"]);
    CHECK(counts["field_points"] > 1000);
    const json mixed = explanation(
        "stymo-edit mix --model run/model.safetensors --source fit/codes.json --target "
        "fit/codes.json --take tex --samples 4 --out explained-mix");
    CHECK_FALSE(made(mixed, "encoder"));
    CHECK(mixed["counts"]["field_points"] >= 4 * 1024);
    const json scored = explanation(
        "stymo-eval --model run/model.safetensors --data faces --ids 0-1 --fit --steps 2");
    CHECK(scored["counts"]["faces_scored"] == 2);
    CHECK(scored["counts"]["photos_encoded"] == 2);
    CHECK(scored["loss_terms"].contains("regularizer"));
    CHECK(scored["counts"]["field_points"] > 0);
}

TEST_CASE("Tools and commands without counts of their own explain, too", "[explain]") {
    const json drawn = explanation("stymo-synth --out explained-heads --count 1 --size 64");
    CHECK(drawn["counts"]["buffers"] > 0);
    CHECK(drawn["networks"].empty());
    const json read = explanation("stymo-edit disentangle --model run/model.safetensors --pairs 2");
    CHECK(made(read, "encoder"));
    CHECK(read["counts"]["field_points"] > 0);
}

TEST_CASE("A training without a second stage makes no discriminator", "[explain]") {
    const ToolOutcome outcome = explained(train + "--out explained-run --set stage1.steps=1");
    CHECK_THAT(outcome.err, !Catch::Contains("discriminator"));
    const json explain = json::parse(outcome.out)["explain"];
    CHECK(made(explain, "encoder"));
    CHECK_FALSE(made(explain, "discriminator"));
    CHECK_FALSE(made(explain, "lpips"));
    CHECK(explain["loss_terms"].contains("reconstruction"));
    CHECK_FALSE(explain["loss_terms"].contains("adversarial"));
    CHECK(explain["counts"]["steps"] == 1);
    CHECK(explain["counts"]["gradients"] > 0);
}

TEST_CASE("Without --explain nothing is explained", "[explain]") {
    const ToolOutcome outcome = stymo::run_tool(stymo::tiny_run(), render + "--json");
    CHECK(outcome.err.empty());
    CHECK_FALSE(json::parse(outcome.out).contains("explain"));
}
