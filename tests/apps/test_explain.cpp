// --explain: the plan and what was counted, on stderr and in the JSON object.
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
    CHECK_THAT(outcome.err, Catch::Contains("plan\n") && Catch::Contains("counts\n"));
    return outcome;
}

json explanation(const std::string& command) {
    return json::parse(explained(command).out)["explain"];
}

/// Of a list of modules or terms, whether the one of this name is used.
bool used(const json& parts, const std::string& name, const char* key) {
    const auto found = std::ranges::find_if(parts, [&](const json& part) { return part["name"] == name; });
    INFO(name);
    REQUIRE(found != parts.end());
    return (*found)[key].get<bool>();
}

bool made(const json& explain, const std::string& module) {
    return used(explain["modules"], module, "made");
}
bool computed(const json& explain, const std::string& term) {
    return used(explain["computed"], term, "computed");
}

const std::string render = "stymo-render --model run/model.safetensors --codes fit/codes.json --out explained.png ";
const std::string fit = "stymo-fit --model run/model.safetensors --data faces --id 00011 --out explained-fit ";
const std::string train = "stymo-train --config tiny.json --data faces ";

}  // namespace

TEST_CASE("Rendering makes neither encoder nor gradients, and the mask branch only if its picture is wanted", "[explain]") {
    const json plain = explanation(render + "--mode exact --samples 4"),
               masked = explanation(render + "--mode exact --samples 4 --mask");
    CHECK_FALSE(made(plain, "encoder"));
    CHECK_FALSE(made(plain, "discriminator"));
    CHECK_FALSE(made(plain, "LPIPS"));
    CHECK_FALSE(made(plain, "mask branch of the renderer"));
    CHECK(made(masked, "mask branch of the renderer"));
    CHECK_FALSE(computed(plain, "gradients"));
    const json& counts = plain["counts"];
    CHECK(counts["gradient_rules"] == 0);
    CHECK(counts["gradients"] == 0);
    CHECK(counts["samples_of_the_last_frame"] == 4 * 1024);
    CHECK(counts["through_the_field"] == 4 * 1024);
    CHECK(counts["field_points"] == 4 * 1024);
    CHECK(counts["tiles"] > 0);
    CHECK(counts["pixels_computed"] == 64 * 64);
    CHECK(counts["peak_bytes"] > 0);
    // Of the tiny model's one render block: a lateral, and the layer that joins them.
    CHECK(counts["layers_computed"].get<int>() + 2 == masked["counts"]["layers_computed"].get<int>());
    CHECK(counts["layers"] == masked["counts"]["layers"]);
    CHECK(counts["operations"] < masked["counts"]["operations"]);
    CHECK(counts["parameters_made"] == masked["counts"]["parameters_made"]);
}

TEST_CASE("A fit makes LPIPS only for its weight or for a metric, and has gradients of codes alone", "[explain]") {
    const json without = explanation(fit + "--steps 2");
    CHECK(made(without, "encoder"));
    CHECK_FALSE(made(without, "LPIPS"));
    CHECK_FALSE(computed(without, "perceptual loss"));
    CHECK(computed(without, "gradients of the codes"));
    CHECK_FALSE(computed(without, "gradients of the weights"));
    CHECK_FALSE(computed(without, "gradients of the pose"));
    CHECK(without["counts"]["steps"] == 2);
    CHECK(without["counts"]["gradients"] == 2 * 4);

    const json with = explanation(fit + "--steps 2 --perceptual-weight 0.1 --lpips-trunk random --lpips-heads random");
    CHECK(made(with, "LPIPS"));
    CHECK(computed(with, "perceptual loss"));
    CHECK(without["counts"]["parameters_made"] < with["counts"]["parameters_made"]);
    CHECK(without["counts"]["gradient_rules"] < with["counts"]["gradient_rules"]);
    CHECK(without["counts"]["peak_bytes"] < with["counts"]["peak_bytes"]);
}

TEST_CASE("A training without a second stage makes no discriminator, and says so", "[explain]") {
    const ToolOutcome outcome = explained(train + "--out explained-run --set stage1.steps=1");
    CHECK_THAT(outcome.err, Catch::Contains("not made    discriminator: there is no second stage"));
    const json explain = json::parse(outcome.out)["explain"];
    CHECK(made(explain, "encoder"));
    CHECK_FALSE(made(explain, "discriminator"));
    CHECK_FALSE(made(explain, "LPIPS"));
    CHECK(computed(explain, "photometric loss"));
    CHECK_FALSE(computed(explain, "adversarial loss"));
    CHECK(explain["counts"]["steps"] == 1);
    CHECK(explain["counts"]["gradients"] > 0);
}

TEST_CASE("Without --explain nothing is explained", "[explain]") {
    const ToolOutcome outcome = stymo::run_tool(stymo::tiny_run(), render + "--json");
    CHECK(outcome.err.empty());
    CHECK_FALSE(json::parse(outcome.out).contains("explain"));
}
