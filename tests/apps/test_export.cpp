// stymo-export: files that other programs read, and what it refuses.
#include <zlib.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "apps/common/coefficient_files.h"
#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "core/io/tensor_file.h"
#include "nn/models/code_file.h"
#include "render/camera.h"

namespace export_tests {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::tiny_run;
using stymo::ToolOutcome;

ToolOutcome done(const std::string& command) {
    ToolOutcome outcome = stymo::run_tool(tiny_run(), "stymo-export " + command);
    INFO(command << "\n" << outcome.err);
    CHECK(outcome.exit_code == 0);
    return outcome;
}

void refused(const std::string& command, int exit_code, const std::string& culprit,
             const std::string& unwritten) {
    const ToolOutcome outcome = stymo::run_tool(tiny_run(), "stymo-export " + command);
    INFO(command << "\n" << outcome.err);
    CHECK(outcome.exit_code == exit_code);
    CHECK(stymo::line_count(outcome.err) == 1);
    CHECK_THAT(outcome.err, Catch::StartsWith("stymo-export: ") && Catch::Contains(culprit));
    CHECK(outcome.out.empty());
    CHECK_FALSE(fs::exists(tiny_run() / unwritten));
}

std::vector<double> expression_of(const fs::path& codes) {
    return stymo::read_code_file(codes).codes.expression().value().to_vector();
}

/// What a tool that succeeds in the folder prints.
std::string done_in(const stymo::ScratchFolder& folder, const std::string& command) {
    const ToolOutcome outcome = stymo::run_tool(folder.path(), command);
    INFO(command << "\n" << outcome.err);
    REQUIRE(outcome.exit_code == 0);
    return outcome.out;
}

}  // namespace

TEST_CASE("Coefficients are written for programs that use ARKit, and come back as codes",
          "[export]") {
    const json result = json::parse(done("arkit --codes fit/codes.json --out face.csv --json").out);
    CHECK(result["coefficients"].size() == 52);
    CHECK(result["errors"]["coefficients_miss_mm"] <= result["errors"]["expression_mm"]);
    const std::string csv = stymo::read_file(tiny_run() / "face.csv");
    CHECK_THAT(csv, Catch::StartsWith("Timecode,BlendShapeCount,EyeBlinkLeft,EyeLookDownLeft,") &&
                        Catch::Contains("\n00:00:00:00.000,61,"));
    CHECK(stymo::line_count(csv) == 2);
    done("arkit --codes fit/codes.json --out face.json");
    for (const std::string file : {"face.csv", "face.json"}) {
        done("arkit --codes fit/codes.json --coefficients " + file + " --out back.json");
        CHECK(json::parse(stymo::read_file(tiny_run() / "back.json"))["model"] ==
              json::parse(stymo::read_file(tiny_run() / "fit/codes.json"))["model"]);
        done("arkit --codes back.json --out again.json");
        const json again = json::parse(stymo::read_file(tiny_run() / "again.json"));
        for (const auto& [name, value] : result["coefficients"].items())
            CHECK(again["coefficients"][name].get<double>() ==
                  Approx(value.get<double>()).margin(0.02));
    }
    // Two rows are two faces that differ from the given one in their expressions.
    stymo::write_file(tiny_run() / "two.csv", csv + csv.substr(csv.find('\n') + 1));
    done("arkit --codes fit/codes.json --coefficients two.csv --out two.jsonl");
    CHECK(stymo::line_count(stymo::read_file(tiny_run() / "two.jsonl")) == 2);
    CHECK(expression_of(tiny_run() / "back.json") != expression_of(tiny_run() / "fit/codes.json"));
}

TEST_CASE("Rotations of the head go through Live Link Face's CSV, and turn it as they should",
          "[export]") {
    const stymo::ScratchFolder folder;
    stymo::ArkitMoment moment{std::vector<double>(stymo::arkit_names.size())};
    const std::string zeros = live_link_csv(moment);
    CHECK(zeros.ends_with(",0,0,0,0,0,0\n"));
    const std::string start = zeros.substr(0, zeros.size() - 18);
    const auto view = [&](const std::string& rotations) {
        stymo::write_file(folder / "a.csv", start + rotations + ",0,0,0,0,0,0\n");
        return stymo::read_coefficients(folder / "a.csv").front().view;
    };
    const auto seen = [&](const std::string& rotations, const Eigen::Vector3d& point) {
        const Eigen::Vector3d angles = view(rotations);
        return Eigen::Vector2d(
            project(camera_from_pose(stymo::orbit_pose(angles[0], angles[1], angles[2], 5.0), {}),
                    point)
                .head<2>());
    };
    const Eigen::Vector3d nose(0.0, 0.0, 1.0), crown(0.0, 1.0, 0.0);
    CHECK(seen("0.3,0,0", nose).x() > 0.55);   // to its left, which is on the right in a picture
    CHECK(seen("0,0.3,0", nose).y() < 0.45);   // up
    CHECK(seen("0,0,0.3", crown).x() < 0.45);  // to its right shoulder
    moment.view = view("0.3,-0.2,0.1");
    stymo::write_file(folder / "b.csv", live_link_csv(moment));
    CHECK((stymo::read_coefficients(folder / "b.csv").front().view - moment.view).norm() < 1e-12);
    // A cell that is not read may be empty, also the last one.
    stymo::write_file(folder / "c.csv", zeros.substr(0, zeros.size() - 2) + "\n");
    CHECK(stymo::read_coefficients(folder / "c.csv").size() == 1);
}

TEST_CASE("What cannot be exported is refused in one line, and nothing is written", "[export]") {
    const std::string mesh = "mesh --codes fit/codes.json --model run/model.safetensors ";
    refused(mesh + "--out no.stl", 2, "must end in .glb or .obj or .ply", "no.stl");
    refused(mesh + "--out no.glb --texture 1000", 2, "power of two", "no.glb");
    refused(mesh + "--out file/no.glb", 1, "file", "no.glb");
    refused(mesh + "--out no.glb --morphable zero.png", 1, "zero.png", "no.glb");
    stymo::TensorFile fog = stymo::read_tensor_file(tiny_run() / "run/model.safetensors");
    fog.tensors.at("decoder.field.density.bias") = stymo::Tensor::full({1}, -50.0);
    stymo::write_tensor_file(tiny_run() / "fog.safetensors", fog);
    const std::string foggy = " --model fog.safetensors --out no.glb";
    refused("mesh --codes fit/codes.json" + foggy, 1, "codes of another model", "no.glb");
    json unmarked = json::parse(stymo::read_file(tiny_run() / "fit/codes.json"));
    unmarked.erase("model");
    stymo::write_file(tiny_run() / "unmarked.json", unmarked.dump());
    refused("mesh --codes unmarked.json" + foggy, 1, "unmarked.json: this face has no surface",
            "no.glb");
    const std::string splat = "splat --codes unmarked.json ";
    refused(splat + "--out no.splat", 2, "must end in .ply or .spz", "no.splat");
    refused(splat + "--out no.ply --count 10", 2, "--count", "no.ply");
    refused(splat + "--out file/no.spz --model run/model.safetensors", 1, "file", "no.spz");
    refused(splat + "--model fog.safetensors --out no.spz", 1, "has no surface", "no.spz");
    const std::string arkit = "arkit --codes fit/codes.json ";
    stymo::write_file(tiny_run() / "no_codes.json", R"({"pose": {}})");
    refused("arkit --codes no_codes.json --out no.json", 1, "\"code\" is missing", "no.json");
    refused(arkit + "--out no.txt", 2, "must end in .json or .csv", "no.txt");
    const auto with = [&](const std::string& text) {
        stymo::write_file(tiny_run() / "bad.csv", text);
        return arkit + "--coefficients bad.csv --out no.json";
    };
    refused(with("Timecode,BlendShapeCount,jawOpen\n"), 1, "has no column EyeBlinkLeft", "no.json");
    refused(with(""), 1, "has no column EyeBlinkLeft", "no.json");
    refused(with("Timecode,JawOpen,JawOpen\n"), 1, "has two columns JawOpen", "no.json");
    done(arkit + "--out good.csv");
    const std::string good = stymo::read_file(tiny_run() / "good.csv");
    refused(with(good + "1,2\n"), 1, "line 3 has 2 cells, the first 63", "no.json");
    refused(with(good.substr(0, good.find('\n') + 1)), 1, "holds no coefficients", "no.json");
    std::string odd = good;
    refused(with(odd.replace(odd.find(",61,") + 4, 1, "x")), 1, "EyeBlinkLeft is \"x", "no.json");
    refused(with(good + good.substr(good.find('\n') + 1)), 2, ".jsonl", "no.json");
    stymo::write_file(tiny_run() / "bad.json", R"({"coefficients": {"jawopen": 1}})");
    refused(arkit + "--coefficients bad.json --out no.json", 1, "is none of ARKit's", "no.json");
}

TEST_CASE("The shipped model's faces become glTF files", "[export][slow]") {
    const stymo::ScratchFolder folder;
    const auto run = [&](const std::string& command) { return done_in(folder, command); };
    run("stymo-render --sample 1 --out drawn");
    const json result =
        json::parse(run("stymo-export mesh --codes drawn/0000.json --out a.glb --texture 256 "
                        "--check a.png --json --explain"));
    CHECK(result["explain"]["counts"]["field_points"] > 0);
    // Straight on the mesh is the frame, apart from the rim.
    CHECK(result["check"]["psnr_inside"][4] > 26.0);
    CHECK(result["check"]["overlap"][4] > 0.9);
    const std::string bytes = stymo::read_file(folder / "a.glb");
    const auto word = [&](std::size_t at) {
        std::uint32_t value = 0;
        std::memcpy(&value, bytes.data() + at, 4);
        return std::size_t{value};
    };
    REQUIRE(bytes.substr(0, 4) == "glTF");
    CHECK(word(8) == bytes.size());
    const json gltf = json::parse(bytes.substr(20, word(12)));
    const json& primitive = gltf["meshes"][0]["primitives"][0];
    CHECK(primitive["targets"].size() ==
          result["exact"].get<std::size_t>() + result["composed"].get<std::size_t>());
    CHECK(gltf["meshes"][0]["extras"]["targetNames"].size() == primitive["targets"].size());
    const json& positions = gltf["accessors"][primitive["attributes"]["POSITION"].get<int>()];
    CHECK(positions["count"] == result["vertices"]);
    // A head in metres, y up.
    const double height = positions["max"][1].get<double>() - positions["min"][1].get<double>();
    CHECK(height > 0.15);
    CHECK(height < 0.3);
    run("stymo-export mesh --codes drawn/0000.json --out b.obj --texture 256");
    for (const char* file : {"b.obj", "b.mtl", "b_texture.png"}) CHECK(fs::exists(folder / file));
}

TEST_CASE("The shipped model's faces become splats, the same in both formats", "[export][slow]") {
    const stymo::ScratchFolder folder;
    const auto run = [&](const std::string& command) { return done_in(folder, command); };
    run("stymo-render --sample 1 --out drawn");
    const std::string splat = "stymo-export splat --codes drawn/0000.json --count 10000 ";
    const json result = json::parse(run(splat + "--out a.ply --check a.png --json"));
    const auto count = result["splats"].get<std::size_t>();
    CHECK(count == Approx(10000).epsilon(0.1));
    CHECK(result["check"]["psnr_inside"][4] > 30.0);
    CHECK(result["check"]["overlap"][4] > 0.95);
    run(splat + "--out a.spz");
    const std::string ply = stymo::read_file(folder / "a.ply");
    const std::size_t body = ply.find("end_header\n") + 11;
    constexpr std::size_t columns = 26;
    REQUIRE(ply.size() == body + 4 * columns * count);
    const auto number = [&](std::size_t row, std::size_t column) {
        float value = 0.0F;
        std::memcpy(&value, ply.data() + body + 4 * (columns * row + column), 4);
        return double{value};
    };
    // 16 bytes, then for all splats their places, opacities, colours, scales, turns, harmonics.
    std::string spz(16 + 28 * count + 1, '\0');
    const gzFile packed = gzopen((folder / "a.spz").c_str(), "rb");
    REQUIRE(gzread(packed, spz.data(), unsigned(spz.size())) == int(spz.size()) - 1);
    gzclose(packed);
    CHECK(spz.substr(0, 8) == std::string("NGSP\2\0\0\0", 8));
    CHECK(spz[12] == 1);
    const auto byte = [&](std::size_t at) { return double(static_cast<unsigned char>(spz[at])); };
    for (std::size_t i = 0; i < count; i += 97) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::size_t at = 16 + 3 * (3 * i + axis);
            double place = byte(at) + 256.0 * byte(at + 1) + 65536.0 * byte(at + 2);
            if (place >= 8388608.0) place -= 16777216.0;
            CHECK(place / double(1 << spz[13]) * (axis == 0 ? 1.0 : -1.0) ==
                  Approx(number(i, axis)).margin(1e-6));
            const std::size_t color = 16 + 10 * count + 3 * i + axis;
            CHECK((byte(color) / 255.0 - 0.5) / 0.15 == Approx(number(i, 6 + axis)).margin(0.014));
            CHECK(byte(color + 3 * count) / 16.0 - 10.0 ==
                  Approx(number(i, 19 + axis)).margin(0.032));
        }
        CHECK(byte(16 + 9 * count + i) / 255.0 ==
              Approx(1.0 / (1.0 + std::exp(-number(i, 18)))).margin(0.002));
        // The third axis of either turn is the normal.
        const auto normal_z = [](double x, double y) { return 1.0 - 2.0 * (x * x + y * y); };
        const std::size_t turn = 16 + 16 * count + 3 * i;
        CHECK(normal_z(byte(turn) / 127.5 - 1.0, byte(turn + 1) / 127.5 - 1.0) ==
              Approx(-number(i, 5)).margin(0.02));
        CHECK(normal_z(number(i, 23), number(i, 24)) == Approx(number(i, 5)).margin(1e-5));
        CHECK(byte(16 + 19 * count + 9 * i + 6) / 128.0 - 1.0 ==
              Approx(std::clamp(number(i, 11), -1.0, 127.0 / 128.0)).margin(0.004));
    }
}

}  // namespace export_tests
