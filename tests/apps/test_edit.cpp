// stymo-edit on tiny data: files, reports, and what it refuses.
#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/image.h"

namespace edit_tests {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::run_tool;
using stymo::tiny_run;
using stymo::ToolOutcome;

const std::string mix = "stymo-edit mix --model run/model.safetensors ";
const std::string color =
    "stymo-edit color --model run/model.safetensors --codes fit/codes.json "
    "--parser " STYMO_SOURCE_DIR "/tests/golden/onnx/face_parser_celebamask.onnx ";

ToolOutcome done(const std::string& command) {
    ToolOutcome outcome = run_tool(tiny_run(), command);
    INFO(command << "\n" << outcome.err);
    CHECK(outcome.exit_code == 0);
    return outcome;
}

void check_refused(const std::string& command, int exit_code, const std::string& culprit) {
    const ToolOutcome outcome = run_tool(tiny_run(), command);
    INFO(command << "\n" << outcome.err);
    CHECK(outcome.exit_code == exit_code);
    CHECK(outcome.out.empty());
    CHECK(stymo::line_count(outcome.err) == 1);
    CHECK_THAT(outcome.err, Catch::Contains("stymo-edit: ") && Catch::Contains(culprit));
    CHECK_FALSE(fs::exists(tiny_run() / "out"));
}

json parsed(const fs::path& file) {
    return json::parse(stymo::read_file(tiny_run() / file));
}

/// Another face's codes beside those of the tiny run.
void make_other_face() {
    if (!fs::exists(tiny_run() / "other/codes.json"))
        done(
            "stymo-fit --model run/model.safetensors --data faces --id 00010 --out other --steps "
            "3");
}

}  // namespace

TEST_CASE(
    "stymo-edit mix writes the target's codes with the source's groups, an image and a report") {
    make_other_face();
    const json report = json::parse(done(mix + "--source other/codes.json --target fit/codes.json "
                                               "--take expr,light --out mixed_faces --json")
                                        .out);
    CHECK(report == parsed("mixed_faces/report.json"));
    CHECK(report["taken"] == json({"expr", "light"}));
    const json mixed = parsed("mixed_faces/codes.json");
    const json source = parsed("other/codes.json");
    const json target = parsed("fit/codes.json");
    for (const char* group : {"expr", "light"})
        CHECK(mixed["code"][group] == source["code"][group]);
    for (const char* group : {"id", "tex"}) CHECK(mixed["code"][group] == target["code"][group]);
    CHECK(mixed["pose"] == target["pose"]);
    CHECK(stymo::read_image(tiny_run() / "mixed_faces/mix.png").shape() ==
          stymo::Shape{64, 3 * 64, 3});
    CHECK(stymo::read_image(tiny_run() / "mixed_faces/render.png").shape() ==
          stymo::Shape{64, 64, 3});
}

TEST_CASE("Several sources or targets make a sheet with a block for each group") {
    make_other_face();
    const std::string faces =
        "--source fit/codes.json --source other/codes.json --target fit/codes.json ";
    CHECK(json::parse(done(mix + faces + "--out sheet --json").out)["blocks"] ==
          json({"expr", "tex", "light"}));
    CHECK(stymo::read_image(tiny_run() / "sheet/sheet.png").shape() ==
          stymo::Shape{3 * 64, 6 * 64, 3});
    done(mix + faces + "--take id --out sheet");
    CHECK(stymo::read_image(tiny_run() / "sheet/sheet.png").shape() ==
          stymo::Shape{3 * 64, 2 * 64, 3});
}

TEST_CASE("Sources may be drawn from the training's codes, and are the same for the same seed") {
    const std::string command =
        mix + "--sample 2 --truncation 0.5 --target fit/codes.json --take id --out drawn --json ";
    const json report = json::parse(done(command).out);
    CHECK(report["sources"] == json({"sample 0", "sample 1"}));
    const std::string sheet = stymo::read_file(tiny_run() / "drawn/sheet.png");
    CHECK(stymo::read_image(tiny_run() / "drawn/sheet.png").shape() ==
          stymo::Shape{3 * 64, 2 * 64, 3});
    done(command);
    CHECK(stymo::read_file(tiny_run() / "drawn/sheet.png") == sheet);
    done(command + "--seed 5");
    CHECK(stymo::read_file(tiny_run() / "drawn/sheet.png") != sheet);
}

TEST_CASE("stymo-edit color writes codes that differ in texture, an image and a report") {
    // The network calls grey hair, and a hardly trained model is grey.
    const json report = json::parse(
        done(color + "--part hair --color #a03020 --steps 5 --regularizer 0 --out colored --json")
            .out);
    CHECK(report == parsed("colored/report.json"));
    CHECK(report["target"] == "#a03020");
    CHECK(report["pixels"].get<int>() > 0);
    CHECK(report["share_of_way"].get<double>() > 0.0);
    CHECK(report["loss"].size() == 5);
    CHECK(report["outside_l1_mean"].get<double>() >= 0.0);
    const json edited = parsed("colored/codes.json");
    const json before = parsed("fit/codes.json");
    for (const char* group : {"id", "expr", "light"})
        CHECK(edited["code"][group] == before["code"][group]);
    CHECK(edited["code"]["tex"] != before["code"]["tex"]);
    CHECK(edited["pose"] == before["pose"]);
    CHECK(stymo::read_image(tiny_run() / "colored/color.png").shape() ==
          stymo::Shape{64, 3 * 64, 3});
    CHECK_THAT(done(color + "--part hair+eye_g --color #A03020 --steps 0 --out colored").out,
               Catch::Contains("0.0 % of the way"));
}

TEST_CASE(
    "stymo-edit disentangle gives sixteen movements of decoded faces and of drawn heads, the same "
    "for the same seed") {
    const std::string command = "stymo-edit disentangle --model run/model.safetensors --pairs 2 ";
    const json report = json::parse(done(command + "--json").out);
    CHECK(report["pairs"] == 2);
    for (const char* kind : {"decoded", "drawn"})
        for (const char* replaced : {"id", "expr", "tex", "light"})
            for (const char* read : {"id", "expr", "tex", "light", "largest_leak"})
                CHECK(report[kind][replaced][read].get<double>() >= 0.0);
    CHECK(json::parse(done(command + "--json").out) == report);
    CHECK(json::parse(done(command + "--seed 1 --json").out) != report);
    CHECK_THAT(done(command).out,
               Catch::Contains("decoded faces") && Catch::Contains("drawn heads"));
}

TEST_CASE("What stymo-edit cannot do is said in one line, and nothing is written") {
    const std::string faces = mix + "--source fit/codes.json --target fit/codes.json --out out ";
    check_refused("stymo-edit", 2, "command");
    check_refused(faces, 2, "--take");
    check_refused(faces + "--take face", 2, "face");
    check_refused(mix + "--target fit/codes.json --take id --out out", 2, "--source");
    check_refused(mix + "--source fit/codes.json --take id --out out", 2, "--target");
    check_refused(mix + "--source none.json --target fit/codes.json --take id --out out", 1,
                  "none.json: ");
    check_refused(mix + "--source fit/codes.json --target tiny.json --take id --out out", 1,
                  "tiny.json: ");
    check_refused(faces.substr(0, faces.find("--out")) + "--take id --out file", 1, "file");
    check_refused(color + "--part hair --color red --out out", 2, "red");
    check_refused(color + "--part hair --color #12345g --out out", 2, "#12345g");
    check_refused(color + "--part beard --color #a03020 --out out", 2, "beard");
    check_refused(color + "--part hair --color #a03020 --learning-rate nan --out out", 2,
                  "--learning-rate");
    check_refused(color + "--part hat --color #a03020 --out out", 2, "no part of a head");
    check_refused(color + "--part ear_r --color #a03020 --out out", 1, "no ear_r");
    check_refused(color + "--part hair --color #a03020 --out file", 1, "file");
    check_refused(color + "--part hair --color #a03020 --out fit", 2,
                  "fit/codes.json, which is read, would be replaced");
    check_refused(faces.substr(0, faces.find("--out")) + "--take id --out fit", 2,
                  "fit/codes.json, which is read, would be replaced");
    check_refused(
        "stymo-edit color --model run/model.safetensors --codes fit/codes.json --part hair --color "
        "#a03020 --parser "
        "text.png --out out",
        1, "text.png: ");
    check_refused("stymo-edit disentangle --model none", 1, "none: ");
    check_refused("stymo-edit disentangle --model run/model.safetensors --pairs 0", 2, "--pairs");
}

}  // namespace edit_tests
