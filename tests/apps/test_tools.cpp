// The tools from end to end on tiny data: files, exit codes, what stdout and stderr hold.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "core/io/image.h"
#include "core/io/tensor_file.h"
#include "nn/models/model.h"

namespace tool_tests {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::run_tool;
using stymo::ToolOutcome;

std::set<std::string> names_in(const fs::path& folder) {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder))
        names.insert(entry.path().filename().string());
    return names;
}

json parsed_file(const fs::path& file) {
    return json::parse(stymo::read_file(file));
}

/// Runs a command of the tools in the tiny run's folder, which must succeed.
ToolOutcome done(const std::string& command) {
    ToolOutcome outcome = run_tool(stymo::tiny_run(), command);
    INFO(command << "\n" << outcome.err);
    CHECK(outcome.exit_code == 0);
    return outcome;
}

constexpr const char* train = "stymo-train --config tiny.json --data faces ";
constexpr const char* fit = "stymo-fit --model run/model.safetensors ";
constexpr const char* render = "stymo-render --model run/model.safetensors --codes fit/codes.json ";

std::set<std::string> keys(const json& object) {
    std::set<std::string> result;
    for (const auto& item : object.items()) result.insert(item.key());
    return result;
}

}  // namespace

TEST_CASE("stymo-synth writes a folder of faces and nothing else") {
    const fs::path& folder = stymo::tiny_run();
    CHECK(names_in(folder / "faces") ==
          std::set<std::string>{"camera.json", "faces.jsonl", "images", "masks"});
    CHECK(names_in(folder / "faces/images").size() == 12);
    CHECK(names_in(folder / "faces/masks") == names_in(folder / "faces/images"));
    CHECK(stymo::line_count(stymo::read_file(folder / "faces/faces.jsonl")) == 12);
    CHECK(stymo::read_image(folder / "faces/images/00000.png").shape() == stymo::Shape{64, 64, 3});
}

TEST_CASE("A training run leaves everything that fitting, resuming and looking back need") {
    const fs::path run = stymo::tiny_run() / "run";
    std::set<std::string> names = names_in(run);
    CHECK(std::erase_if(names, [](const std::string& name) {
              return name.starts_with("events.out.tfevents.");
          }) == 1);
    CHECK(names == std::set<std::string>{".lock", "checkpoints", "config.json", "latest", "log.txt",
                                         "model.safetensors", "samples", "stats.jsonl"});
    CHECK(names_in(run / "checkpoints/000004") ==
          std::set<std::string>{"checksums.txt", "model.safetensors", "state.safetensors"});
    CHECK(names_in(run / "samples") == std::set<std::string>{"000002.png", "000004.png"});
    CHECK(stymo::read_file(run / "latest") == "000004\n");
    CHECK(stymo::line_count(stymo::read_file(run / "stats.jsonl")) == 4);
    const json config = parsed_file(run / "config.json");
    CHECK(config["stage1"]["steps"] == 4);
    CHECK(config["optimizer"]["beta1"] == 0.9);
}

TEST_CASE("Two steps, stop, resume for two more are four steps, bit for bit") {
    const fs::path& folder = stymo::tiny_run();
    done(std::string(train) + "--out halves --set stage1.steps=2");
    const ToolOutcome outcome = done(std::string(train) + "--out halves --resume latest --json");
    CHECK(json::parse(outcome.out)["steps"] == 4);
    for (const char* file : {"model.safetensors", "checkpoints/000004/model.safetensors",
                             "checkpoints/000004/state.safetensors"}) {
        INFO(file);
        CHECK(stymo::read_file(folder / "halves" / file) ==
              stymo::read_file(folder / "run" / file));
    }
    CHECK(stymo::line_count(stymo::read_file(folder / "halves/stats.jsonl")) == 4);
}

TEST_CASE("The written configuration trains the same model again") {
    done("stymo-train --config run/config.json --data faces --out again");
    const fs::path& folder = stymo::tiny_run();
    CHECK(stymo::read_file(folder / "again/model.safetensors") ==
          stymo::read_file(folder / "run/model.safetensors"));
}

TEST_CASE("A dry run and the table of keys write nothing, and are one object with --json") {
    const ToolOutcome text = done(std::string(train) + "--out dry --dry-run");
    CHECK_THAT(text.out, Catch::Contains("parameters") && Catch::Contains("peak memory"));
    const json plan = json::parse(done(std::string(train) + "--out dry --dry-run --json").out);
    CHECK(plan["images"] == 10);
    CHECK(plan["phases"][0]["steps"] == 4);
    CHECK_FALSE(fs::exists(stymo::tiny_run() / "dry"));
    CHECK_THAT(done("stymo-train --print-keys").out, Catch::StartsWith("| key"));
    CHECK_THAT(done("stymo-train --head-mask --print-keys").out, Catch::StartsWith("| key"));
    CHECK(json::parse(done("stymo-train --print-keys --json").out).is_object());
}

TEST_CASE("stymo-fit writes four files; the report says how good and how fast") {
    const fs::path& folder = stymo::tiny_run();
    CHECK(names_in(folder / "fit") ==
          std::set<std::string>{"codes.json", "fit.png", "render.png", "report.json"});
    const json report = parsed_file(folder / "fit/report.json");
    CHECK(keys(report) ==
          std::set<std::string>{"initial", "fitted", "steps", "seconds", "loss", "terms"});
    for (const char* when : {"initial", "fitted"})
        for (const char* metric : {"l1", "ssim", "psnr"}) CHECK(report[when][metric].is_number());
    CHECK(report["steps"] == 3);
    CHECK(report["loss"].size() == 3);
    CHECK(stymo::read_image(folder / "fit/render.png").shape() == stymo::Shape{64, 64, 3});
    CHECK(stymo::read_image(folder / "fit/fit.png").shape() == stymo::Shape{64, 4 * 64, 3});
    const json codes = parsed_file(folder / "fit/codes.json");
    CHECK(codes["code"]["id"].size() == 100);
    CHECK(codes["code"]["expr"].size() == 79);
    CHECK(codes["code"]["tex"].size() == 100);
    CHECK(codes["code"]["light"].size() == 27);
}

TEST_CASE(
    "A fit needs a photo only, makes its folder with its parents, and prints one object with "
    "--json") {
    const ToolOutcome outcome =
        done(std::string(fit) +
             "--image faces/images/00001.png --as-is --out new/deep/fit --steps 1 --json");
    CHECK(json::parse(outcome.out) == parsed_file(stymo::tiny_run() / "new/deep/fit/report.json"));
    CHECK(stymo::line_count(outcome.out) == 1);
    CHECK_THAT(outcome.err, Catch::Contains("1/1"));
}

TEST_CASE(
    "A second fit into the same folder replaces the files of the first and leaves no others") {
    const fs::path& folder = stymo::tiny_run();
    done(std::string(fit) + "--image faces/images/00002.png --as-is --out twice --steps 1");
    const std::string first = stymo::read_file(folder / "twice/codes.json");
    done(std::string(fit) +
         "--image faces/images/00003.png --mask faces/masks/00003.png --pose fit/codes.json --out "
         "twice --steps 2");
    CHECK(stymo::read_file(folder / "twice/codes.json") != first);
    CHECK(parsed_file(folder / "twice/report.json")["steps"] == 2);
    CHECK(names_in(folder / "twice").size() == 4);
    CHECK(parsed_file(folder / "twice/codes.json")["pose"]["yaw_deg"].get<double>() ==
          Approx(parsed_file(folder / "fit/codes.json")["pose"]["yaw_deg"].get<double>()));
}

TEST_CASE("stymo-fit warns of a score far below its model's, and of a fit that is not kept") {
    const fs::path& folder = stymo::tiny_run();
    const auto warnings = [&](const std::string& options) {
        const ToolOutcome outcome =
            done("stymo-fit --data faces --id 00011 --out doubtful " + options);
        std::vector<std::string> lines = parsed_file(folder / "doubtful/report.json")
                                             .value("warnings", std::vector<std::string>());
        for (const std::string& line : lines) CHECK_THAT(outcome.err, Catch::Contains(line));
        return lines;
    };
    const double psnr = parsed_file(folder / "fit/report.json")["fitted"]["psnr"];
    stymo::TensorFile model = stymo::read_tensor_file(folder / "run/model.safetensors");
    const auto with_usual = [&](double decibels) {
        model.metadata["validation_psnr"] = std::to_string(decibels);
        stymo::write_tensor_file(folder / "usual.safetensors", model);
        return warnings("--model usual.safetensors --steps 3");
    };
    CHECK(with_usual(psnr + 4.0).empty());
    const std::vector<std::string> low = with_usual(psnr + 5.0);
    REQUIRE(low.size() == 1);
    CHECK_THAT(low.front(), Catch::Contains("far below what photos usually reach with this model"));

    const std::vector<std::string> thrown =
        warnings("--model run/model.safetensors --steps 3 --learning-rate 10");
    REQUIRE(thrown.size() == 1);
    CHECK_THAT(thrown.front(), Catch::StartsWith("the fit ended no better than it began"));
    const json report = parsed_file(folder / "doubtful/report.json");
    CHECK(report["fitted"] == report["initial"]);
}

TEST_CASE("What is ignored in a photo does not change its fit, tuning or scores") {
    const fs::path& folder = stymo::tiny_run();
    stymo::Tensor photo = stymo::read_image(folder / "faces/images/00004.png");
    const std::int64_t side = photo.shape(0);
    stymo::Tensor cover = stymo::Tensor::zeros({side, side, 1});
    const auto pixels = photo.mutable_values<float>();
    const auto covered = cover.mutable_values<float>();
    for (std::int64_t i = side * side / 2; i < side * side * 3 / 4; ++i) {
        covered[static_cast<std::size_t>(i)] = 1.0F / 255.0F;  // numpy's ones are taken for white
        std::fill_n(pixels.begin() + 3 * i, 3, i % 2 == 0 ? 1.0F : 0.0F);
    }
    fs::create_directories(folder / "covers");
    stymo::write_image(folder / "covers/00004.png", photo);
    stymo::write_image(folder / "covers/mask.png", cover);
    const std::string known =
        " --mask faces/masks/00004.png --ignore covers/mask.png --steps 2 --tune-steps 2 --out ";
    const ToolOutcome bare = done(fit + ("--image faces/images/00004.png" + known + "ignored_a"));
    CHECK_THAT(bare.err, Catch::Contains("warning: covers/mask.png has values of 0 and 1"));
    done(fit + ("--image covers/00004.png" + known + "ignored_b"));
    for (const char* name : {"codes.json", "render.png", "fit.png", "tuned.safetensors"})
        CHECK(stymo::read_file(folder / "ignored_a" / name) ==
              stymo::read_file(folder / "ignored_b" / name));
    const json a = parsed_file(folder / "ignored_a/report.json"),
               b = parsed_file(folder / "ignored_b/report.json");
    for (const char* when : {"initial", "fitted", "tuned"}) CHECK(a[when] == b[when]);
    stymo::write_image(folder / "covers/all.png", stymo::Tensor::full({side, side, 1}, 1.0));
    stymo::write_image(folder / "covers/wide.png", stymo::Tensor::full({16, 32, 3}, 0.5));
    stymo::Tensor middle = stymo::Tensor::zeros({16, 32, 1});
    for (std::size_t i = 0; i < 512; ++i)
        if (i % 32 >= 8 && i % 32 < 24) middle.mutable_values<float>()[i] = 1.0F;
    stymo::write_image(folder / "covers/middle.png", middle);
    for (const auto& [wrong, reason] : std::map<std::string, std::string>{
             {"--as-is --ignore covers/all.png", "covers/all.png: leaves nothing of the photo"},
             {"--as-is --image covers/wide.png --ignore covers/middle.png",
              "covers/middle.png: leaves nothing of the photo's central square"},
             {"--mask zeros.png", "zeros.png: covers nothing (every pixel is 0)"}}) {
        stymo::write_image(folder / "zeros.png", stymo::Tensor::zeros({side, side, 1}));
        const ToolOutcome refused = stymo::run_tool(
            folder, fit + ("--out refused " + wrong +
                           (wrong.find("--image") == std::string::npos ? " --image covers/00004.png"
                                                                       : "")));
        CHECK(refused.exit_code == 1);
        CHECK_THAT(refused.err, Catch::Contains(reason));
    }
}

TEST_CASE("A fit from a folder whose dataset.json cannot be used says so") {
    const fs::path& folder = stymo::tiny_run();
    fs::create_directories(folder / "labelled/images");
    fs::copy_file(folder / "faces/images/00004.png", folder / "labelled/images/a.png",
                  fs::copy_options::overwrite_existing);
    stymo::write_file(folder / "labelled/dataset.json", R"({"labels": {"a.png": [1, 0, 0]}})");
    const ToolOutcome outcome =
        done(fit + std::string("--data labelled --id a --steps 0 --out unlabelled"));
    CHECK_THAT(outcome.err,
               Catch::Contains("dataset.json: its labels are no cameras of EG3D; the face counts "
                               "as frontal"));
}

TEST_CASE("Fitting from a folder of faces is fitting the same files one by one") {
    const fs::path& folder = stymo::tiny_run();
    done(std::string(fit) + "--data faces --id 00004 --out by_id --steps 1");
    done(std::string(fit) +
         "--image faces/images/00004.png --mask faces/masks/00004.png --pose by_id/codes.json "
         "--out by_files --steps 1");
    json by_id = parsed_file(folder / "by_id/report.json");
    json by_files = parsed_file(folder / "by_files/report.json");
    CHECK(by_id["loss"][0].get<double>() ==
          Approx(by_files["loss"][0].get<double>()).epsilon(1e-6));
}

TEST_CASE(
    "Grey, transparent, palette, 16-bit, turned and odd-sized photos are fitted and trained on") {
    const fs::path& folder = stymo::tiny_run();
    const fs::path golden = fs::path(STYMO_SOURCE_DIR) / "tests/golden/images";
    fs::create_directories(folder / "mixed");
    for (const auto& entry : fs::directory_iterator(golden))
        fs::copy_file(entry.path(), folder / "mixed" / entry.path().filename(),
                      fs::copy_options::overwrite_existing);
    stymo::write_image(folder / "mixed/odd.jpg", stymo::Tensor::full({91, 37, 1}, 0.5));
    for (const std::string& name : names_in(folder / "mixed")) {
        std::string command = fit;
        done(
            command.append("--image mixed/").append(name).append(" --as-is --out kinds --steps 1"));
    }
    const ToolOutcome outcome = done(
        "stymo-train --config tiny.json --data mixed --out kinds_run --set data.split.test=0 "
        "--set data.other_photo=0.5 --set data.turned_photos=0.5");
    CHECK_THAT(outcome.err, Catch::Contains("data.turned_photos: 0 of "));
    CHECK_THAT(outcome.err, Catch::Contains("data.other_photo: 0 of " +
                                            std::to_string(names_in(folder / "mixed").size()) +
                                            " photos have another one of the same person"));
    CHECK_THAT(outcome.err,
               Catch::Contains(std::to_string(names_in(folder / "mixed").size()) + " faces") &&
                   !Catch::Contains("broken"));
}

TEST_CASE(
    "Images, masks and depth are written as their names say, from the photo's side and any other") {
    const fs::path& folder = stymo::tiny_run();
    const ToolOutcome outcome =
        done(std::string(render) + "--out views/own.png --samples 4 --mask --depth --json");
    CHECK(json::parse(outcome.out)["written"] ==
          json{"views/own.png", "views/own_mask.png", "views/own_depth.exr"});
    const std::vector<double> own = stymo::read_image(folder / "views/own.png").to_vector();
    const std::vector<double> fitted = stymo::read_image(folder / "fit/render.png").to_vector();
    REQUIRE(own.size() == fitted.size());
    for (std::size_t i = 0; i < own.size(); ++i) CHECK(std::abs(own[i] - fitted[i]) < 1.5 / 255.0);
    CHECK(stymo::read_mask(folder / "views/own_mask.png").shape() == stymo::Shape{64, 64, 1});
    CHECK(stymo::read_image(folder / "views/own_depth.exr").shape() == stymo::Shape{64, 64, 3});
    done(std::string(render) +
         "--out views/side.jpg --yaw -20 --pitch 5 --roll 3 --samples 8 --size 64");
    CHECK(stymo::read_image(folder / "views/side.jpg").shape() == stymo::Shape{64, 64, 3});
    CHECK(names_in(folder / "views") ==
          std::set<std::string>{"own.png", "own_mask.png", "own_depth.exr", "side.jpg"});
}

TEST_CASE("Every way of rendering writes the image, the mask and the depth") {
    const fs::path& folder = stymo::tiny_run();
    for (const std::string mode : {"exact", "skip"}) {
        const std::string name = "modes/" + mode;
        done(std::string(render) + "--out " + name +
             ".png --samples 4 --mask --depth --tolerance 0.01 --mode " + mode);
        CHECK(stymo::read_image(folder / (name + ".png")).shape() == stymo::Shape{64, 64, 3});
        CHECK(stymo::read_mask(folder / (name + "_mask.png")).shape() == stymo::Shape{64, 64, 1});
        CHECK(stymo::read_image(folder / (name + "_depth.exr")).shape() == stymo::Shape{64, 64, 3});
    }
}

TEST_CASE("An orbit becomes a GIF or a film, of one frame or more") {
    const fs::path& folder = stymo::tiny_run();
    done(std::string(render) + "--out orbit.gif --orbit 3 --samples 4");
    done(std::string(render) + "--out orbit.mp4 --orbit 3 --samples 4");
    done(std::string(render) + "--out one.gif --orbit 1 --samples 4");
    done(std::string(render) + "--out one.mp4 --orbit 1 --samples 4");
    CHECK(stymo::read_file(folder / "orbit.gif").starts_with("GIF89a"));
    CHECK(stymo::read_file(folder / "orbit.mp4").substr(4, 4) == "ftyp");
    CHECK(fs::file_size(folder / "one.gif") < fs::file_size(folder / "orbit.gif"));
    CHECK(fs::file_size(folder / "one.mp4") > 0);
}

TEST_CASE("stymo-eval scores the faces that were asked for, and the fitted codes too with --fit") {
    const std::string eval = "stymo-eval --model run/model.safetensors --data faces ";
    const std::string fitted =
        eval + "--split test --fit --refine-pose --steps 2 --json --out scored";
    const ToolOutcome outcome = done(fitted);
    const json scores = json::parse(outcome.out);
    CHECK(scores["count"] == 2);
    CHECK(keys(scores["faces"]) == std::set<std::string>{"00010", "00011"});
    for (const char* when : {"initial", "fitted"}) {
        const json& faces = scores["faces"];
        const double mean = (faces["00010"]["head"][when]["l1"].get<double>() +
                             faces["00011"]["head"][when]["l1"].get<double>()) /
                            2;
        CHECK(scores["mean"]["head"][when]["l1"].get<double>() == Approx(mean));
    }
    const fs::path out = stymo::tiny_run() / "scored";
    CHECK(names_in(out) == std::set<std::string>{".lock", "codes", "report.json", "report.md",
                                                 "scores.jsonl", "settings.json", "sheet.png"});
    CHECK(names_in(out / "codes") == std::set<std::string>{"00010.json", "00011.json"});
    CHECK(stymo::read_image(out / "sheet.png").shape() == stymo::Shape{2 * 64, 6 * 64, 3});
    CHECK(parsed_file(out / "report.json")["settings"]["--refine-pose"] == true);
    CHECK(parsed_file(out / "report.json")["mean"] == scores["mean"]);
    CHECK(json::parse(done(fitted).out) == scores);
    CHECK(stymo::line_count(stymo::read_file(out / "scores.jsonl")) == 2);
    done(
        "stymo-render --model run/model.safetensors --codes scored/codes/00011.json --out "
        "scored_view.png --samples 4");
    // As many evaluations of another optimiser end at another loss.
    const json other = json::parse(
        done(eval + "--split test --fit --optimizer lbfgs --steps 8 --json --out other").out);
    const json same =
        json::parse(done(eval + "--split test --fit --optimizer adam --steps 8 --json").out);
    CHECK(other["mean"]["head"]["fitted"] != same["mean"]["head"]["fitted"]);
    CHECK(other["mean"]["head"]["initial"] == same["mean"]["head"]["initial"]);
    CHECK(parsed_file(stymo::tiny_run() / "other/report.json")["settings"]["--optimizer"] ==
          "lbfgs");
    const ToolOutcome text = done(eval + "--ids 3");
    CHECK_THAT(text.out, Catch::Contains("initial") && !Catch::Contains("fitted"));
}

TEST_CASE("stymo-eval goes on only with the same value of every option that can change a score") {
    const fs::path& folder = stymo::tiny_run();
    const std::string eval = "stymo-eval --model run/model.safetensors --data faces --ids 3 ";
    done(eval + "--out begun");
    const fs::path file = folder / "begun/settings.json";
    const json begun = parsed_file(file);
    const auto refuse = [&](const json& settings, const std::string& changed,
                            const std::string& reason) {
        stymo::write_file(file, settings.dump() + "\n");
        const ToolOutcome outcome = run_tool(folder, eval + changed + "--out begun");
        CHECK(outcome.exit_code == 1);
        CHECK_THAT(outcome.err, Catch::Contains("begun with other settings (" + reason));
    };
    const std::set<std::string> keep_results{"--help", "--help-all", "--version", "--threads",
                                             "--json", "--out",      "--explain", "--one-by-one"};
    std::set<std::string> declared;
    std::istringstream help(done("stymo-eval --help").out);
    const std::regex option_line("^  (?:-\\w,)?(--[a-z-]+)");
    std::smatch found;
    for (std::string line; std::getline(help, line) && line != "Subcommands:";) {
        if (!std::regex_search(line, found, option_line)) continue;
        const std::string option = found[1];
        CAPTURE(option);
        declared.insert(option);
        CHECK(begun.contains(option) != keep_results.contains(option));
        if (keep_results.contains(option)) continue;
        json other = begun;
        other[option] = "another";
        refuse(other, "", option + " was \"another\"");
    }
    CHECK(std::ranges::includes(declared, keep_results));
    CHECK(declared.size() == begun.size() + keep_results.size());
    refuse(begun, "--seed 1 ", "--seed was 0, now 1)");
    refuse(begun, "--matmul-precision highest ", "--matmul-precision was \"high\"");
    refuse(begun, "--resolution 64 ", "--resolution was 0, now 64)");
    stymo::write_file(file, begun.dump() + "\n");
    done(eval + "--out begun --threads 2 --one-by-one");
}

TEST_CASE("LPIPS is measured where it was asked for, and random weights are called so") {
    const std::string eval =
        "stymo-eval --model run/model.safetensors --data faces --ids 10 --lpips squeeze ";
    const std::string random = "--lpips-trunk random --lpips-heads random ";
    const json scores = json::parse(done(eval + random + "--json").out);
    CHECK(scores["mean"]["head"]["initial"]["lpips"].is_number());
    CHECK(scores["lpips_network"] == "squeezenet1_1, random weights");
    CHECK_THAT(done(eval + random).out, Catch::Contains("LPIPS: squeezenet1_1, random weights"));

    const std::string options = "--image faces/images/00001.png --out perceptual --steps 2 --json ";
    const json report = json::parse(done(fit + options + random + "--perceptual-weight 0.5").out);
    CHECK(report["fitted"]["lpips"].is_number());
    CHECK(report["lpips_network"] == "vgg16, random weights");
}

TEST_CASE("A tuned face is written beside its codes, and rendered and mixed with them") {
    const fs::path& folder = stymo::tiny_run();
    done(std::string(fit) + "--data faces --id 00011 --steps 2 --tune-steps 3 --out tuned");
    CHECK(names_in(folder / "tuned") == std::set<std::string>{"codes.json", "fit.png", "render.png",
                                                              "report.json", "tuned.safetensors"});
    const json report = parsed_file(folder / "tuned/report.json");
    CHECK(report["tuned"]["psnr"].is_number());
    CHECK(stymo::read_image(folder / "tuned/fit.png").shape() == stymo::Shape{64, 5 * 64, 3});
    const std::string face = "--codes tuned/codes.json --out tuned/";
    const std::string tool = "stymo-render --model run/model.safetensors ";
    done(tool + face + "plain.png");
    done(tool + face + "with.png --samples 4 --tuned tuned/tuned.safetensors");
    const auto pixels = [&](const char* name) {
        return stymo::read_image(folder / "tuned" / name).to_vector();
    };
    CHECK_FALSE(pixels("plain.png") == pixels("with.png"));
    CHECK((pixels("with.png") == pixels("render.png")));
    done(
        "stymo-edit mix --model run/model.safetensors --tuned tuned/tuned.safetensors "
        "--source tuned/codes.json --target fit/codes.json --take id --out tuned/mixed");
    json other = parsed_file(folder / "tuned/codes.json");
    for (json& number : other["code"]["id"]) number = number.get<double>() + 0.5;
    stymo::write_file(folder / "other_person.json", other.dump());
    CHECK_THAT(done(tool + "--codes other_person.json --out other_person.png --tuned "
                           "tuned/tuned.safetensors")
                   .err,
               Catch::Contains("was tuned for another face than other_person.json"));
    // The changes of an earlier face's weights do not stay beside the codes of another.
    done(std::string(fit) + "--data faces --id 00010 --steps 2 --out tuned");
    CHECK(names_in(folder / "tuned").count("tuned.safetensors") == 0);
}

TEST_CASE("A published model is half as large, names no files and shows the same face") {
    const fs::path& folder = stymo::tiny_run();
    done("stymo-weights publish run/model.safetensors published.safetensors");
    CHECK(20 * fs::file_size(folder / "published.safetensors") <
          11 * fs::file_size(folder / "run/model.safetensors"));
    done("stymo-render --model published.safetensors --codes fit/codes.json --out published.png");
    done(std::string(render) + "--out whole.png");
    const stymo::ModelConfig config = stymo::Model::load(folder / "published.safetensors").config();
    CHECK(config.reconstruction.perceptual.network == "encoder");
    CHECK(config.reconstruction.perceptual.trunk.empty());
    done(
        "stymo-fit --model published.safetensors --data faces --id 00011 --steps 2 "
        "--perceptual-weight 0.1 --out published");
    const stymo::Tensor a = stymo::read_image(folder / "published.png"),
                        b = stymo::read_image(folder / "whole.png");
    for (std::size_t i = 0; i < a.values<float>().size(); ++i)
        REQUIRE(std::abs(a.values<float>()[i] - b.values<float>()[i]) < 0.02F);
}

TEST_CASE("stymo-fit fits by L-BFGS, and lets LPIPS compare smaller images") {
    const std::string options =
        std::string(fit) + "--image faces/images/00001.png --as-is --json --optimizer lbfgs ";
    const json report = json::parse(done(options + "--out lbfgs --steps 5 --coarse-steps 2").out);
    const std::vector<double> losses = report["loss"].get<std::vector<double>>();
    REQUIRE(losses.size() == 5);
    CHECK(losses.back() < losses.front());
    const std::string perceptual =
        "--steps 1 --lpips-trunk random --lpips-heads random --perceptual-weight 0.5 ";
    const json whole = json::parse(done(options + "--out lbfgs-whole " + perceptual).out);
    const json half = json::parse(
        done(options + "--out lbfgs-half --perceptual-resolution 32 " + perceptual).out);
    CHECK(whole["loss"][0] != half["loss"][0]);
}

TEST_CASE("stymo-eval pair compares two images") {
    const std::string pair = "stymo-eval pair faces/images/00000.png faces/images/00001.png ";
    const json plain = json::parse(done(pair + "--json").out);
    CHECK(keys(plain) == std::set<std::string>{"l1", "l1_mean", "ssim", "psnr"});
    const json measured = json::parse(
        done(pair + "--lpips alex --lpips-trunk random --lpips-heads random --json").out);
    CHECK(measured["l1"] == plain["l1"]);
    double total = 0.0;
    for (const json& term : measured["lpips_terms"]) total += term.get<double>();
    CHECK(measured["lpips_terms"].size() == 5);
    CHECK(measured["lpips"].get<double>() == Approx(total));
    CHECK(measured["lpips_network"] == "alexnet, random weights");
    CHECK_THAT(done(pair).out, Catch::Contains("PSNR") && !Catch::Contains("LPIPS"));
    const json equal = json::parse(
        done("stymo-eval pair faces/images/00000.png faces/images/00000.png --json").out);
    CHECK(equal["l1"] == 0.0);
}

}  // namespace tool_tests
