// What stymo-render does beside one view: sheets, faces on the way to another, new faces, meshes.
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/render/images.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/metrics.h"
#include "core/ops/elementwise.h"
#include "nn/models/code_file.h"
#include "nn/models/model.h"
#include "nn/realtime/view.h"
#include "render/soft_edge.h"
#include "support/check_close.h"

namespace render_tool_tests {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::Model;
using stymo::read_code_file;
using stymo::read_image;
using stymo::Shape;
using stymo::tiny_run;
using stymo::ToolOutcome;
using namespace stymo::test;

constexpr const char* render = "stymo-render --model run/model.safetensors --samples 4 ";
constexpr const char* of_fit = "--codes fit/codes.json ";

ToolOutcome done(const std::string& options) {
    ToolOutcome outcome = stymo::run_tool(tiny_run(), render + options);
    INFO(options << "\n" << outcome.err);
    CHECK(outcome.exit_code == 0);
    return outcome;
}

void refused(const std::string& options, int exit_code, const std::string& culprit) {
    const ToolOutcome outcome = stymo::run_tool(tiny_run(), render + options);
    INFO(options << "\n" << outcome.err);
    CHECK(outcome.exit_code == exit_code);
    CHECK(stymo::line_count(outcome.err) == 1);
    CHECK_THAT(outcome.err, Catch::StartsWith("stymo-render: ") && Catch::Contains(culprit));
    CHECK(outcome.out.empty());
}

std::vector<double> numbers(const fs::path& codes) {
    return joined(read_code_file(tiny_run() / codes).codes).value().to_vector();
}

/// A tile of an image of tiles of 64 pixels.
stymo::Tensor tile(const std::string& image, int row, int column) {
    return stymo::image_part(read_image(tiny_run() / image), 64 * row, 64 * column, 64, 64);
}

}  // namespace

TEST_CASE("An animation that would not fit into memory is refused before its first frame",
          "[render_tool]") {
    const stymo::Model model = stymo::Model::load(tiny_run() / "run/model.safetensors");
    const stymo::CodeFile face = read_code_file(tiny_run() / "fit/codes.json");
    const stymo::ShotList list{.shots = std::vector<stymo::Shot>(100000, {face.codes, face.pose})};
    stymo::RenderOptions options;
    options.orbit = 100000;
    CHECK_THROWS_AS(stymo::write_images(tiny_run() / "long.gif", options, model, list),
                    stymo::UsageError);
    CHECK_THROWS_WITH(stymo::write_images(tiny_run() / "long.gif", options, model, list),
                      "--orbit: 100000 frames of 64 x 64 pixels need 4.6 GiB of memory, more than "
                      "4; give a smaller --orbit or --size");
}

TEST_CASE("A grid shows yaw from left to right and pitch from top to bottom, as single views do",
          "[render_tool]") {
    done(std::string(of_fit) +
         "--out grid.png --grid-yaw -20:20:3 --grid-pitch 10:-10:2 --depth --mask");
    CHECK(read_image(tiny_run() / "grid.png").shape() == Shape{128, 192, 3});
    CHECK(stymo::read_mask(tiny_run() / "grid_mask.png").shape() == Shape{128, 192, 1});
    CHECK(read_image(tiny_run() / "grid_depth.exr").shape() == Shape{128, 192, 3});
    done(std::string(of_fit) + "--out single.png --yaw 20 --pitch 10");
    CHECK(identical(read_image(tiny_run() / "single.png"), tile("grid.png", 0, 2)));
    done(std::string(of_fit) + "--out column.png --grid-pitch 10:10:1 --yaw 20");
    CHECK(identical(read_image(tiny_run() / "single.png"), read_image(tiny_run() / "column.png")));
}

TEST_CASE("The head turns around its middle, or around the face", "[render_tool]") {
    const auto view = [](const std::string& options) {
        done(of_fit + options + " --out around.png");
        return read_image(tiny_run() / "around.png");
    };
    CHECK(identical(view("--yaw 30"), view("--yaw 30 --around head")));
    CHECK_FALSE(identical(view("--yaw 30"), view("--yaw 30 --around face")));
    CHECK(peak_signal_to_noise_ratio(view("--yaw 0 --distance 1"),
                                     view("--yaw 0 --distance 1 --around face")) > 60.0);
}

TEST_CASE("A view from farther away turns around the same point", "[render_tool]") {
    const Model model = Model::load(tiny_run() / "run/model.safetensors");
    const stymo::CameraConfig& config = model.config().camera;
    const auto center = [&](const stymo::RenderOptions& options) {
        const stymo::Pose pose = chosen_pose(options, model, stymo::frontal_pose(config));
        return camera_from_pose(pose, config.intrinsics).center;
    };
    const Eigen::Vector3d middle(0.0, 0.0, stymo::head_middle);
    stymo::RenderOptions usual, turned;
    turned.yaw = 20.0;
    CHECK(usual.chosen_distance() == 1.0);
    CHECK(turned.chosen_distance() == stymo::whole_head_distance);
    for (stymo::RenderOptions options : {usual, turned}) {
        options.distance = 1.0;
        const Eigen::Vector3d before = center(options) - middle;
        options.distance = 1.5;
        CHECK((center(options) - middle - 1.5 * before).norm() < 1e-12);
    }
    refused(std::string(of_fit) + "--distance 3 --out far.png", 2, "--distance");
}

TEST_CASE("A path keeps the wanted decibels, says what was measured, and few views are exact",
          "[render_tool]") {
    const ToolOutcome path =
        done(std::string(of_fit) + "--orbit 16 --psnr 40 --out path.gif --json");
    CHECK_THAT(path.err, Catch::Contains("dB, and a pixel off by"));
    const json result = json::parse(path.out);
    CHECK(result["checked_views"] == 1);
    CHECK(result["worst_psnr"] >= 40.0);
    CHECK(result["worst_pixel"] < 0.2);
    CHECK(result["mode"] == "skip");
    const ToolOutcome few =
        done(std::string(of_fit) + "--orbit 2 --distance 1 --out few.gif --json --explain");
    CHECK_FALSE(json::parse(few.out).contains("checked_views"));
    const json counts = json::parse(few.out)["explain"]["counts"];
    CHECK(counts["through_the_field"] == counts["samples_of_the_last_frame"]);
}

TEST_CASE("The depth alone needs no render block", "[render_tool]") {
    const ToolOutcome alone = done(std::string(of_fit) + "--out alone.exr --json --explain");
    CHECK(json::parse(alone.out)["explain"]["counts"]["pixels_computed"] == 0);
    done(std::string(of_fit) + "--out both.png --depth");
    CHECK(
        identical(read_image(tiny_run() / "alone.exr"), read_image(tiny_run() / "both_depth.exr")));
    CHECK(json::parse(alone.out)["written"].size() == 1);
    refused(std::string(of_fit) + "--out alone.exr --mask", 2, "--mask needs an image");
}

TEST_CASE(
    "Faces on the way to another are a strip or an animation, and keep the groups that are not "
    "taken",
    "[render_tool]") {
    done("--sample 1 --truncation 1 --out other");
    const std::string way = std::string(of_fit) + "--to other/0000.json --yaw 0 ";
    done(way + "--frames 3 --out way.png");
    CHECK(read_image(tiny_run() / "way.png").shape() == Shape{64, 192, 3});
    done(std::string(of_fit) + "--yaw 0 --out from.png");
    done("--codes other/0000.json --yaw 0 --out to.png");
    CHECK(identical(tile("way.png", 0, 0), read_image(tiny_run() / "from.png")));
    CHECK(identical(tile("way.png", 0, 2), read_image(tiny_run() / "to.png")));
    done(way + "--frames 3 --out way.gif --mask --depth");
    CHECK(stymo::read_file(tiny_run() / "way_mask.gif").starts_with("GIF89a"));
    for (const char* frame : {"way_0000_depth.exr", "way_0002_depth.exr"})
        CHECK(fs::exists(tiny_run() / frame));
    CHECK_FALSE(fs::exists(tiny_run() / "way_0003_depth.exr"));
}

TEST_CASE("New faces come with a sheet and their codes, the same for the same seed however many",
          "[render_tool]") {
    const ToolOutcome outcome = done("--sample 3 --out new --json");
    CHECK(json::parse(outcome.out)["written"] ==
          json{"new/faces.png", "new/0000.json", "new/0001.json", "new/0002.json"});
    CHECK(read_image(tiny_run() / "new/faces.png").shape() == Shape{128, 128, 3});
    done("--sample 2 --out again");
    CHECK(numbers("again/0001.json") == numbers("new/0001.json"));
    CHECK(numbers("new/0000.json") != numbers("new/0001.json"));
    done("--sample 1 --out another --seed 1");
    CHECK(numbers("another/0000.json") != numbers("new/0000.json"));
    done("--codes new/0001.json --out face.png");
    CHECK(identical(read_image(tiny_run() / "face.png"), tile("new/faces.png", 0, 1)));
}

TEST_CASE("New faces narrow to the mean, and may change some groups of a given face alone",
          "[render_tool]") {
    const stymo::Model model = stymo::Model::load(tiny_run() / "run/model.safetensors");
    REQUIRE(model.code_statistics());
    done("--sample 1 --truncation 0 --out mean");
    CHECK(numbers("mean/0000.json") == model.code_statistics()->mean().to_vector());

    done(std::string(of_fit) + "--sample 1 --take expr,light --out changed");
    done("--sample 1 --out all");
    const std::vector<double> fit = numbers("fit/codes.json"),
                              changed = numbers("changed/0000.json"),
                              all = numbers("all/0000.json");
    for (std::size_t i = 0; i < fit.size(); ++i) {
        const bool taken = (i >= 100 && i < 179) || i >= 279;
        REQUIRE(changed[i] == (taken ? all[i] : fit[i]));
    }
}

TEST_CASE("A model without statistics draws new faces from a folder's", "[render_tool]") {
    const std::string checkpoint =
        "stymo-render --samples 4 --model run/checkpoints/000004/model.safetensors --sample 1 "
        "--out bare";
    const ToolOutcome without = stymo::run_tool(tiny_run(), checkpoint);
    CHECK(without.exit_code == 1);
    CHECK_THAT(without.err, Catch::Contains("model.safetensors: has no statistics") &&
                                Catch::Contains("--data"));
    CHECK_FALSE(fs::exists(tiny_run() / "bare"));
    CHECK(stymo::run_tool(tiny_run(), checkpoint + " --data faces").exit_code == 0);
    CHECK(fs::exists(tiny_run() / "bare/0000.json"));
}

TEST_CASE("A mesh is written alone or beside an image", "[render_tool]") {
    // Four steps of training make no head; any density has a surface.
    const std::string surface = "--mesh head.ply --mesh-resolution 12 --mesh-level 0.05 ";
    const ToolOutcome outcome = done(of_fit + surface + "--json");
    CHECK(json::parse(outcome.out)["written"] == json{"head.ply"});
    CHECK(stymo::read_file(tiny_run() / "head.ply")
              .starts_with("ply\nformat binary_little_endian 1.0\n"));
    done(of_fit + surface + "--out beside.png");
    CHECK(fs::exists(tiny_run() / "beside.png"));
    refused(std::string(of_fit) + "--mesh head.ply --mesh-resolution 4 --mesh-level 1000000", 1,
            "no density of this face reaches");
}

TEST_CASE("Jobs of stymo-render that do not fit together are refused", "[render_tool]") {
    const std::string one = std::string(of_fit) + "--out out.png ";
    refused("--out out.png", 2, "--codes");
    refused(of_fit, 2, "--out");
    refused("--sample 2", 2, "--out");
    refused(one + "--grid-yaw 1:2", 2, "--grid-yaw 1:2");
    refused(one + "--grid-pitch 0:10:0", 2, "--grid-pitch");
    refused(one + "--grid-yaw 0:200:3", 2, "--grid-yaw");
    refused(one + "--grid-yaw 0:20:3x", 2, "--grid-yaw");
    refused(one + "--grid-yaw 0:20:3 --sample 2", 2, "--sample");
    refused(one + "--take hair --to fit/codes.json", 2, "\"hair\"");
    refused(one + "--frames 3", 2, "--to");
    refused(one + "--to none.json", 1, "none.json: ");
    refused(one + "--mesh head.obj", 2, "head.obj");
    refused("--sample 2 --truncation nan --out new", 2, "--truncation");
    CHECK_FALSE(fs::exists(tiny_run() / "out.png"));
}

TEST_CASE("A cutout has the head's colours and its opacity as alpha", "[render_tool]") {
    done(std::string(of_fit) + "--out whole.png --mask --raw");
    const stymo::Tensor whole = read_image(tiny_run() / "whole.png"),
                        mask = stymo::read_mask(tiny_run() / "whole_mask.png");
    const auto check_alpha = [&](const std::string& options, const stymo::Tensor& alpha) {
        INFO(options);
        done(std::string(of_fit) + "--out cut.png --cutout" + options);
        // read_image puts the head on black.
        const stymo::Tensor on_black = read_image(tiny_run() / "cut.png");
        REQUIRE(on_black.shape() == whole.shape());
        std::size_t compared = 0;
        for (; compared < on_black.values<float>().size(); ++compared)
            CHECK(std::abs(on_black.values<float>()[compared] -
                           whole.values<float>()[compared] * alpha.values<float>()[compared / 3]) <
                  3.0F / 255.0F);
        CHECK(compared == 3 * 64 * 64);
    };
    check_alpha(" --raw", mask);
    check_alpha("", stymo::soft_opacity(mask));
    CHECK_FALSE(fs::exists(tiny_run() / "cut_mask.png"));
    for (const char* out : {"cut.jpg", "cut.gif --orbit 3", "cut.gif --to fit/codes.json"})
        refused(std::string(of_fit) + "--cutout --out " + out, 2, "--cutout needs a .png file");
    done("--sample 2 --out cut-new --cutout");
    CHECK(read_image(tiny_run() / "cut-new/faces.png").shape() == Shape{64, 128, 3});
}

TEST_CASE("A model that overflows is refused with one line in each mode, and nothing is written",
          "[render_tool]") {
    const stymo::Model broken = [] {
        stymo::Model model = stymo::Model::load(tiny_run() / "run/model.safetensors");
        for (const stymo::Parameter& parameter : model.parameters().all())
            if (parameter.name().starts_with("decoder.block64"))
                parameter.set_value((parameter.variable() * 1e25).value());
        return model;
    }();
    broken.save(tiny_run() / "broken.safetensors");
    json codes = json::parse(stymo::read_file(tiny_run() / "fit/codes.json"));
    codes.erase("model");
    stymo::write_file(tiny_run() / "no_mark.json", codes.dump());
    for (const std::string command :
         {"stymo-render --codes no_mark.json --mode exact --out broken.png",
          "stymo-render --codes no_mark.json --mode skip --out broken.png",
          "stymo-render --codes no_mark.json --tolerance 0.1 --out broken.png",
          "stymo-render --codes no_mark.json --orbit 2 --out broken.gif",
          "stymo-eval --data faces --ids 0"}) {
        const ToolOutcome outcome =
            stymo::run_tool(tiny_run(), command + " --model broken.safetensors");
        INFO(command << "\n" << outcome.err);
        CHECK(outcome.exit_code == 1);
        CHECK_THAT(outcome.err, Catch::Contains("not finite"));
        CHECK(outcome.out.empty());
    }
    for (const char* file : {"broken.png", "broken.gif"})
        CHECK_FALSE(fs::exists(tiny_run() / file));
}

TEST_CASE("Codes of another model are neither rendered nor mixed", "[render]") {
    json other = json::parse(stymo::read_file(tiny_run() / "fit/codes.json"));
    REQUIRE(other.contains("model"));
    other["model"] = "00000000";
    stymo::write_file(tiny_run() / "other_model.json", other.dump());
    refused("--codes other_model.json --out no.png", 1, "codes of another model");
    refused(of_fit + std::string("--to other_model.json --frames 3 --out no.gif"), 1,
            "codes of another model");
    CHECK_FALSE(fs::exists(tiny_run() / "no.png"));
    const ToolOutcome mixed = stymo::run_tool(
        tiny_run(),
        "stymo-edit mix --model run/model.safetensors --source other_model.json --target "
        "fit/codes.json --take expr --out no_mix");
    CHECK(mixed.exit_code == 1);
    CHECK_THAT(mixed.err, Catch::Contains("codes of another model"));
}

}  // namespace render_tool_tests
