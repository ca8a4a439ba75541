#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/eval/evaluate.h"
#include "apps/tiny_run.h"
#include "core/error.h"

namespace {

using stymo::FaceScore;
using stymo::parse_range;

const std::vector<FaceScore> two_scores = {{"a", {0.3, 0.1, 0.5, 20.0}, {0.2, 0.06, 0.7, 24.0}},
                                           {"b", {0.1, 0.04, 0.7, 10.0}, {0.0, 0.0, 0.9, 12.0}}};

}  // namespace

TEST_CASE("A range of faces is one place, two, or from one to the end") {
    CHECK(parse_range("700-799").first == 700);
    CHECK(parse_range("700-799").last == 799);
    CHECK(parse_range("5").first == 5);
    CHECK(parse_range("5").last == 5);
    CHECK(parse_range("7-7").last == 7);
    CHECK(parse_range("700-").first == 700);
    CHECK(parse_range("700-").last == -1);
    CHECK(parse_range("").first == 0);
    CHECK(parse_range("").last == -1);
}

TEST_CASE("Anything else is no range of faces") {
    const auto text = GENERATE("x", "-3", "1-2-3", "5-2", "1-x", "1.5", " 1", "1 ", "99999999999999999999", "-");
    CHECK_THROWS_AS(parse_range(text), stymo::UsageError);
    CHECK_THROWS_WITH(parse_range(text), Catch::Contains("--ids"));
}

TEST_CASE("The scores of a folder are the means over its faces") {
    const auto json = nlohmann::json::parse(stymo::to_json(two_scores, true).text());
    CHECK(json["count"] == 2);
    CHECK(json["mean"]["initial"]["psnr"].get<double>() == Approx(15.0));
    CHECK(json["mean"]["fitted"]["l1"].get<double>() == Approx(0.1));
    CHECK(json["mean"]["fitted"]["ssim"].get<double>() == Approx(0.8));
    CHECK(json["faces"]["b"]["fitted"]["psnr"] == 12.0);
    const auto without = nlohmann::json::parse(stymo::to_json(two_scores, false).text());
    CHECK_FALSE(without["mean"].contains("fitted"));
    CHECK_THAT(stymo::table(two_scores, true), Catch::Contains("15.00") && Catch::Contains("18.00"));
    CHECK_THAT(stymo::table(two_scores, false), !Catch::Contains("fitted"));
}

TEST_CASE("How many faces are fitted at once does not change their scores") {
    const stymo::Model model = stymo::Model::load(stymo::tiny_run() / "run/model.safetensors");
    const stymo::Dataset faces(stymo::tiny_run() / "faces", 64, {}, stymo::Split::all);
    const stymo::ReconstructionLoss loss(model.config().reconstruction);
    stymo::EvaluationOptions options;
    options.range = {0, 2};
    options.fit = true;
    options.fitting.steps = 2;
    options.batch = 1;
    const auto one_by_one = stymo::evaluate(model, loss, faces, options).scores;
    options.batch = 4;
    const auto together = stymo::evaluate(model, loss, faces, options).scores;
    REQUIRE(one_by_one.size() == 3);
    REQUIRE(together.size() == 3);
    for (std::size_t i = 0; i < 3; ++i) {
        CHECK(one_by_one[i].id == together[i].id);
        CHECK(one_by_one[i].fitted.l1 == Approx(together[i].fitted.l1).epsilon(1e-3));
    }
    options.range = {12, -1};
    CHECK_THROWS_AS(stymo::evaluate(model, loss, faces, options), stymo::ConfigError);
}
