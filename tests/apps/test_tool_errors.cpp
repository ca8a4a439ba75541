// Bad input to the real tools: one line that names the culprit, the exit code, nothing written.
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/image.h"

namespace tool_error_tests {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::run_tool;
using stymo::tiny_run;
using stymo::ToolOutcome;

constexpr int failed = 1;
constexpr int wrong_usage = 2;

struct BadCall {
    std::string command;
    std::string culprit;  ///< stands in the line
};

/// Each call must print nothing but a line on stderr (behind `lines_before` others), and leave
/// "out" unmade.
void check_refused(const std::vector<BadCall>& calls, int exit_code,
                   std::ptrdiff_t lines_before = 0) {
    for (const auto& [command, culprit] : calls) {
        const ToolOutcome outcome = run_tool(tiny_run(), command);
        const std::string tool = command.substr(0, command.find(' '));
        INFO(command << "\n" << outcome.err);
        CHECK(outcome.exit_code == exit_code);
        CHECK(outcome.out.empty());
        CHECK(stymo::line_count(outcome.err) == lines_before + 1);
        CHECK_THAT(outcome.err, Catch::Contains(tool + ": ") && Catch::Contains(culprit));
    }
    CHECK_FALSE(fs::exists(tiny_run() / "out"));
    CHECK_FALSE(fs::exists(tiny_run() / "out.png"));
}

json codes() {
    return json::parse(stymo::read_file(tiny_run() / "fit/codes.json"));
}

void write_codes(const char* name, const json& value) {
    stymo::write_file(tiny_run() / name, value.dump());
}

}  // namespace

TEST_CASE("Wrong usage of a tool exits with 2") {
    const std::string fit = "stymo-fit --model run/model.safetensors --out out ";
    const std::string render = "stymo-render --model run/model.safetensors --codes fit/codes.json ";
    const std::string eval = "stymo-eval --model run/model.safetensors --data faces ";
    const std::vector<BadCall> calls = {
        {"stymo-eval", "--data"},
        {"stymo-eval --model run/model.safetensors", "--data"},
        {"stymo-eval pair whole.jpg", "B"},
        {render + "--take tex --out out.png", "--to or --sample"},
        {"stymo-eval pair whole.jpg whole.jpg --lpips-heads random", "--lpips"},
        {eval + "--lpips-heads random", "--lpips or --fit"},
        {eval + "--lpips resnet", "--lpips"},
        {"stymo-synth", "--out"},
        {"stymo-synth --out out --count 0", "--count"},
        {"stymo-synth --out out --count many", "--count"},
        {"stymo-synth --out out --count 1.5", "--count"},
        {"stymo-synth --out out --seed -1", "--seed"},
        {"stymo-prep --photos faces", "--out"},
        {"stymo-train", "--config"},
        {"stymo-train --config tiny.json --data faces", "--out"},
        {"stymo-train --config tiny.json --data faces --out out --max-minutes -1", "--max-minutes"},
        {fit, "--image"},
        {fit + "--data faces", "--id"},
        {fit + "--id 00001", "--data"},
        {fit + "--video film.avi --face 2", "--video"},
        {"stymo-fit --model run/model.safetensors --data faces --id 00001 --out faces",
         "which is read"},
        {"stymo-fit --model run/model.safetensors --image fit/render.png --as-is --out fit",
         "which is read"},
        {fit + "--video film.avi --tune 5", "leave out --tune"},
        {fit + "--image faces/images/00000.png --as-is --every 2", "--video"},
        {fit + "--image faces/images/00000.png --as-is --time-weight 1", "--video"},
        {fit + "--image faces/images/00000.png --as-is --lpips-heads random", "--lpips-trunk"},
        {fit + "--video film.avi --mask faces/images/00000.png", "--video"},
        {fit + "--video film.avi --steps 5", "--video"},
        {fit + "--image faces/images/00000.png --as-is --mask faces/masks/00000.png", "--mask"},
        {fit + "--image faces/images/00000.png --as-is --steps -1", "--steps"},
        {fit + "--image faces/images/00000.png --as-is --learning-rate nan", "--learning-rate"},
        {fit + "--image faces/images/00000.png --as-is --regularizer inf", "--regularizer"},
        {fit + "--image faces/images/00000.png --as-is --samples 1", "--samples"},
        {render + "--out out.tiff", "out.tiff"},
        {render + "--out out.gif", "out.gif"},
        {render + "--out out", "out"},
        {render + "--out out.png --orbit 3", "out.png"},
        {render + "--out out.png --yaw nan", "--yaw"},
        {render + "--out out.gif --orbit 3 --yaw 20", "--yaw"},
        {render + "--out out.png --orbit-yaw 20", "--orbit"},
        {render + "--out out.png --orbit-pitch 5", "--orbit"},
        {render + "--out out.png --grid-yaw -5:5:2 --yaw 20", "--yaw"},
        {"stymo-drive --codes fit/codes.json --out out.mp4 --video film.avi --rate 30",
         "--coefficients"},
        {"stymo-drive --codes fit/codes.json --out out.mp4 --coefficients fit/codes.json "
         "--landmarks text.png",
         "--landmarks requires --video or --truth"},
        {"stymo-drive --codes fit/codes.json --out out.mp4 --coefficients fit/codes.json "
         "--pose-net text.png",
         "--video"},
        {"stymo-export arkit --codes fit/codes.json --out fit/codes.json", "which is read"},
        {"stymo-export mesh --model run/model.safetensors --codes fit/codes.json --out me.obj "
         "--check me_texture.png",
         "the file of the texture"},
        {"stymo-edit color --model run/model.safetensors --codes fit/codes.json --part hat "
         "--color #102030 --parser text.png --out out",
         "no part of a head"},
        {"stymo-edit mix --target fit/codes.json --source fit/codes.json --truncation 1 --out out",
         "--sample"},
        {"stymo-prep --photos faces --out out --distance 5", "--pose-net"},
        {"stymo-weights publish run/model.safetensors run/model.safetensors", "which is read"},
        {"stymo-weights import run/model.safetensors run/model.safetensors", "which is read"},
        {render + "--out out.png --yaw 200", "--yaw"},
        {render + "--out out.png --size 513", "--size"},
        {eval + "--ids 5-2", "5-2"},
        {eval + "--out faces", "which is read"},
        {eval + "--ids all", "all"},
        {eval + "--split rest", "--split"},
        {eval + "--region nose", "--region"},
        {eval + "--parser run/model.safetensors", "--region"},
        {eval + "--refine-pose", "--fit"},
        {eval + "--steps 5", "--fit"},
        {eval + "--perceptual-weight 0", "--fit"},
        {eval + "--region head --parser text.png", "--region face or both"},
        {eval + "--morphable text.png", "--shape or --fit"},
        {"stymo-eval drawn --data faces --identity none --sheet out.tiff", "out.tiff"},
        {"stymo-eval people --model run/model.safetensors", "--data"},
        {"stymo-prep --photos faces --out out --focal 4 --pose-net none.onnx", "--focal"},
        {fit + "--image faces/images/00000.png --image run/00000.png", "two photos"},
        {fit + "--image faces/images/00000.png --as-is --locality 2",
         "--locality requires --tune or --tune-steps"},
        {fit + "--video film.avi --depth-weight 1", "--video"},
        {"stymo-fit --model run/model.safetensors --image faces/images/00000.png --pose "
         "fit/codes.json --out fit",
         "which is read"},
        {"stymo-eval people --data faces --split test",
         "--split is no option of stymo-eval people"},
        {"stymo-eval people --data faces --region face", "--region is no option"},
        {"stymo-prep --focal 4 pose --yaw 10", "--focal is no option of stymo-prep pose"},
        {render + "--out out.png --fps 5", "--fps requires --orbit or --to"},
        {render + "--mesh out.ply --yaw 5", "--out"},
        {render + "--mesh out.ply --cutout", "--cutout needs a .png file as --out"},
        {render + "--sample 2 --out out", "--take"},
    };
    check_refused(calls, wrong_usage);
}

TEST_CASE("Inputs that are missing, empty or something else are named") {
    const std::string fit = "stymo-fit --model run/model.safetensors --out out ";
    const std::string photo = "--image faces/images/00000.png --out out";
    stymo::write_image(tiny_run() / "wide.png", stymo::Tensor::full({32, 64, 3}, 1.0));
    const std::vector<BadCall> calls = {
        {"stymo-synth --out out --morphable none", "none: "},
        {"stymo-synth --out out --morphable run/model.safetensors", "run/model.safetensors: "},
        {"stymo-prep --photos none --out out", "none: no such folder"},
        {"stymo-prep --photos empty --out out", "empty: no images"},
        {"stymo-prep --photos faces --out out --pose-net text.png", "text.png: "},
        {"stymo-prep --photos faces --out run", "run: exists already"},
        {"stymo-prep --photos faces --out faces/images/new", "lies in faces/images"},
        {"stymo-train --config none.json --data faces --out out", "none.json: "},
        {"stymo-train --config text.png --data faces --out out", "text.png: "},
        {"stymo-train --config tiny.json --data none --out out", "none: no such folder"},
        {"stymo-train --config tiny.json --data empty --out out", "empty: no images"},
        {"stymo-fit --model none " + photo, "none: "},
        {"stymo-fit --model empty " + photo, "empty: "},
        {"stymo-fit --model text.png " + photo, "text.png: "},
        {"stymo-fit --model zero.png " + photo, "zero.png: "},
        {"stymo-fit --model cut.safetensors " + photo, "cut.safetensors: "},
        {"stymo-fit --model run/checkpoints/000004/state.safetensors " + photo,
         "not a model of stymo"},
        {fit + "--image none.png", "none.png: "},
        {fit + "--image empty", "empty: "},
        {fit + "--image text.png", "text.png: not an image"},
        {fit + "--image cut.png", "cut.png: "},
        {fit + "--image cut.jpg", "cut.jpg: "},
        {fit + "--image faces/images/00000.png --mask zero.png",
         "zero.png: not an image (zero bytes)"},
        {fit + "--image faces/images/00000.png --mask wide.png", "wide.png: has 64 x 32 pixels"},
        {fit + "--image faces/images/00000.png --pose tiny.json", "tiny.json: "},
        {fit + "--data empty --id 1", "empty: "},
        {fit + "--data faces --id 77", "77"},
        {"stymo-render --model text.png --codes fit/codes.json --out out.png", "text.png: "},
        {"stymo-render --model run/model.safetensors --codes fit/codes.json --out out.png --size "
         "128",
         "64, not 128"},
        {"stymo-render --model run/model.safetensors --codes fit/codes.json --out out.png --tuned "
         "run/model.safetensors",
         "run/model.safetensors: not the weight changes"},
        {"stymo-weights publish text.png out.safetensors", "text.png: "},
        {"stymo-eval --model none --data faces", "none: "},
        {"stymo-eval --model run/model.safetensors --data empty", "empty: "},
        {"stymo-eval --model run/model.safetensors --data faces --ids 12 --out out", "--ids"},
        {"stymo-eval --model run/model.safetensors --data faces --split val --out out",
         "data.split"},
        {"stymo-eval --model run/model.safetensors --data faces --region face --out out",
         "--parser"},
        {"stymo-eval --model run/model.safetensors --data faces --region face --parser text.png "
         "--out out",
         "text.png: "},
        {"stymo-eval --model run/model.safetensors --data faces --lpips vgg16",
         "vgg16-397923af.pth"},
        // The networks come first: the scan of a large folder takes long.
        {"stymo-eval --model run/model.safetensors --data none --lpips vgg16",
         "vgg16-397923af.pth"},
        {"stymo-train --config tiny.json --data none --out out --set "
         "reconstruction.perceptual_weight=0.1 --set reconstruction.perceptual_heads=random --set "
         "reconstruction.perceptual_trunk=no_trunk",
         "no_trunk"},
        {"stymo-eval pair zero.png whole.jpg", "zero.png: not an image (zero bytes)"},
        {"stymo-eval pair whole.jpg text.png", "text.png: not an image"},
        {"stymo-eval pair whole.jpg whole.jpg --lpips squeeze", "squeezenet1_1-b8a52dc0.pth"},
        {"stymo-eval pair whole.jpg whole.jpg --lpips alex --lpips-trunk none --lpips-heads random",
         "no file none"},
        {fit + "--image faces/images/00000.png --as-is --perceptual-weight 0.1",
         "--perceptual-weight 0"},
        {fit + "--image faces/images/00000.png --as-is --perceptual-resolution 48",
         "perceptual_resolution = 48"},
        {fit + "--image faces/images/00000.png --as-is --lpips-trunk text.png --lpips-heads random",
         "text.png: "},
    };
    check_refused(calls, failed);
}

TEST_CASE("A photo of zero bytes gives exactly one line") {
    const ToolOutcome outcome = run_tool(
        tiny_run(), "stymo-fit --model run/model.safetensors --image zero.png --out out --json");
    CHECK(outcome.exit_code == failed);
    CHECK(outcome.out.empty());
    CHECK(outcome.err == "stymo-fit: zero.png: not an image (zero bytes)\n");
}

TEST_CASE("A folder that cannot be made is named by every tool that writes") {
    // The names of a file in place of a folder hold for the superuser too, whom no missing right
    // stops.
    const std::string photo =
        "stymo-fit --model run/model.safetensors --image faces/images/00000.png --as-is ";
    const std::string render = "stymo-render --model run/model.safetensors --codes fit/codes.json ";
    for (const std::string place : {"file", "file/deep"}) {
        check_refused(
            {{"stymo-synth --count 1 --size 32 --out " + place, "file"},
             {photo + "--out " + place, "file"},
             {"stymo-prep --photos faces --out " + place, "file"},
             {render + "--out " + place + "/x.png", "file"},
             {"stymo-eval --model run/model.safetensors --data faces --ids 0 --out " + place,
              "file"}},
            failed);
        check_refused({{"stymo-train --config tiny.json --data faces --out " + place, "file"}},
                      failed, 1);
    }
}

TEST_CASE(
    "A wrong configuration is told by key, value and what is allowed, before anything is written") {
    const std::string train = "stymo-train --config tiny.json --data faces --out out --set ";
    const std::vector<BadCall> calls = {
        {train + "decoder.field_widht=3", "did you mean decoder.field_width?"},
        {train + "decoder.field_width=0",
         "decoder.field_width = 0: must be an integer in [1, 4096]"},
        {train + "decoder.field_width=wide", "decoder.field_width"},
        {train + "decoder.field_width", "key=value"},
        {train + "decoder.rays_per_side=16", "decoder.block_channels"},
        {train + "decoder.rays_per_side=16 --set decoder.block_channels=[8,8] "
                 "--set reconstruction.resolution_weights=[1,1] --set stage2.resolutions=[64]",
         "decoder.rays_per_side = 16"},
        {train + "decoder.near_z=-5", "decoder.near_z = -5"},
        {train + "decoder.resolution=96", "decoder.resolution 96"},
        {train + "decoder.resolution=128 --set decoder.block_channels=[8,8]",
         "reconstruction.resolution_weights"},
        {train + "stage1.micro_batch=3", "stage1.micro_batch = 3"},
        {train + "data.split.test=12", "data.split"},
        {train + "encoder.backbone=vgg", "mobilefacenet, small_conv"},
        {train + "loss.code_weights=[1]", "loss.code_weights"},
    };
    check_refused(calls, failed);
}

TEST_CASE("A run that cannot begin or resume as wanted leaves no run folder behind") {
    const std::string train = "stymo-train --config tiny.json --data faces --out out ";
    check_refused(
        {{train + "--resume latest", "out: no checkpoint to resume from"},
         {train + "--resume none", "none/"},
         {train + "--initial-model faces/images", "faces/images"},
         {train + "--initial-model run/model.safetensors --set decoder.field_width=8", "shape"},
         {train + "--resume run/checkpoints/000004 --seed 3", "--seed 0, not 3"},
         {train + "--resume run/checkpoints/000004 --set decoder.field_width=8", "shape"}},
        failed);
    // The slash of a completed name hides no step.
    fs::create_directory(tiny_run() / "renamed");
    fs::copy(tiny_run() / "run/checkpoints/000004", tiny_run() / "renamed/000009");
    check_refused({{train + "--resume renamed/000009/", "is of step 4, not of step 9"}}, failed);
    check_refused({{train + "--initial-model run/model.safetensors --resume latest",
                    "--resume excludes --initial-model"}},
                  wrong_usage);
}

TEST_CASE(
    "A run folder is not trained over, and a smaller set of heads not mixed into a larger one") {
    const std::string log = stymo::read_file(tiny_run() / "run/log.txt");
    check_refused({{"stymo-train --config tiny.json --data faces --out run",
                    "run: holds a training run already"}},
                  failed, 1);
    CHECK(stymo::read_file(tiny_run() / "run/log.txt") == log);
    std::filesystem::copy(tiny_run() / "run", tiny_run() / "another_run",
                          std::filesystem::copy_options::recursive);
    check_refused({{"stymo-train --config tiny.json --data faces --out run --resume "
                    "another_run/checkpoints/000004",
                    "does not belong"}},
                  failed);
    CHECK(stymo::read_file(tiny_run() / "run/log.txt") == log);
    check_refused({{"stymo-train --config tiny.json --data faces --out faces/images/run",
                    "would count as photos"},
                   {"stymo-eval --model run/model.safetensors --data faces --out faces/images/eval",
                    "would count as photos"}},
                  failed);
    check_refused({{"stymo-synth --out faces --count 5 --size 64", "faces/images/"}}, failed);
}

TEST_CASE(
    "A code file that lacks a group, a number or the pose, or holds what no code is, is refused by "
    "name") {
    const auto refused = [](const json& value, const std::string& culprit) {
        write_codes("wrong.json", value);
        check_refused(
            {{"stymo-render --model run/model.safetensors --codes wrong.json --out out.png",
              culprit}},
            failed);
    };
    json value = codes();
    value["code"]["id"].erase(0);
    refused(value, "wrong.json: \"id\" is not an array of 100 numbers");
    value = codes();
    value["code"].erase("light");
    refused(value, "light");
    value = codes();
    value["code"]["tex"][3] = "red";
    refused(value, "tex");
    value = codes();
    value["code"]["expr"][3] = 1e300;
    refused(value, "expr");
    value = codes();
    value.erase("pose");
    refused(value, "pose");
    value = codes();
    value["pose"]["t"] = {0, 0};
    refused(value, "\"t\"");
    refused(json::array({1}), "code");
    check_refused({{"stymo-render --model run/model.safetensors --codes text.png --out out.png",
                    "text.png: not JSON"}},
                  failed);
}

TEST_CASE(
    "Broken images of a folder are named and left out, whether the set fits into the cache or "
    "not") {
    const fs::path folder = tiny_run() / "broken";
    fs::create_directories(folder);
    for (const char* name : {"00000.png", "00001.png", "00002.png"})
        fs::copy_file(tiny_run() / "faces/images" / name, folder / name,
                      fs::copy_options::overwrite_existing);
    for (const char* name : {"zero.png", "text.png", "cut.jpg"})
        fs::copy_file(tiny_run() / name, folder / name, fs::copy_options::overwrite_existing);
    for (const std::string megabytes : {"2048", "0"}) {
        const ToolOutcome outcome =
            run_tool(tiny_run(),
                     "stymo-train --config tiny.json --data broken --set data.split.test=0 --out "
                     "broken_run" +
                         megabytes + " --set data.cache_megabytes=" + megabytes);
        INFO(outcome.err);
        CHECK(outcome.exit_code == 0);
        for (const char* name :
             {"zero.png: not an image (zero bytes)\n", "text.png: not an image\n", "cut.jpg: "})
            CHECK_THAT(outcome.err, Catch::Contains(std::string("broken/") + name));
    }
    const ToolOutcome scored =
        run_tool(tiny_run(), "stymo-eval --model run/model.safetensors --data broken --json");
    CHECK(json::parse(scored.out)["count"] == 3);
    CHECK_THAT(scored.err, Catch::Contains("broken/zero.png: not an image (zero bytes)"));
    check_refused({{"stymo-fit --model run/model.safetensors --data broken --id zero --out out",
                    "broken/zero.png: not an image (zero bytes)"}},
                  failed);
    for (const char* name : {"00000.png", "00001.png", "00002.png"}) fs::remove(folder / name);
    const std::string train =
        "stymo-train --config tiny.json --data broken --out out --set data.split.test=0 ";
    check_refused({{train, "broken/cut.jpg: "}}, failed);
    check_refused({{train + "--set data.cache_megabytes=0", "broken/cut.jpg: "}}, failed);
    check_refused({{"stymo-eval --model run/model.safetensors --data broken", "broken/cut.jpg: "}},
                  failed);
    check_refused({{"stymo-prep --photos broken --out out", "broken/cut.jpg: "}}, failed, 1);
}

}  // namespace tool_error_tests
