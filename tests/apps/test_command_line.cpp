#include <algorithm>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/common/command_line.h"
#include "core/error.h"
#include "core/matmul_precision.h"

namespace {

struct Outcome {
    int exit_code = -1;
    std::string out;
    std::string err;
};

/// A tool with one option of each kind, whose body fails on request.
struct TinyTool {
    std::filesystem::path image;
    std::filesystem::path folder = "out";
    std::optional<double> yaw;
    std::vector<std::string> assignments;
    std::string mode = "exact";
    std::int64_t steps = 200;
    bool depth = false;
    stymo::CommonOptions common;

    Outcome run(std::vector<const char*> arguments, const std::string& failure = "") {
        stymo::CommandLine line("stymo-tiny", "A tool of the tests.");
        line.option("--image", image, "Photo").required();
        line.option("--out", folder, "Folder");
        line.option("--yaw", yaw, "Degrees");
        line.option("--set", assignments, "key=value").needs("--image");
        line.option("--mode", mode, "Rendering").one_of({"exact", "skip"});
        line.option("--steps", steps, "Steps").range(0, 1000);
        line.flag("--depth", depth, "Depth too");
        arguments.insert(arguments.begin(), "stymo-tiny");
        std::ostringstream out;
        std::ostringstream err;
        const int exit_code = line.run(
            static_cast<int>(arguments.size()), arguments.data(),
            [&](const stymo::CommonOptions& options) {
                common = options;
                if (!failure.empty()) stymo::fail<stymo::FileError>(failure);
                return stymo::AppResult{"all is well",
                                        stymo::JsonValue::object({{"steps", steps}})};
            },
            out, err);
        return {exit_code, out.str(), err.str()};
    }
};

}  // namespace

TEST_CASE("The settings are the values of all options that can change the result") {
    stymo::CommandLine line("stymo-tiny", "A tool of the tests.");
    std::filesystem::path image;
    std::string weights = "random";
    std::optional<std::int64_t> samples;
    double rate = 0.5;
    bool fit = false;
    int jobs = 1;
    line.option("-i,--image", image, "Photo");
    line.option("--weights", weights, "Weights").file_or("random");
    line.option("--samples", samples, "Samples");
    line.option("--rate", rate, "Rate");
    line.flag("--fit", fit, "Fit");
    line.option("--jobs", jobs, "Jobs").keeps_results();
    const auto settings_with = [&](std::vector<const char*> arguments) {
        arguments.insert(arguments.begin(), "stymo-tiny");
        nlohmann::json settings;
        REQUIRE(line.run(static_cast<int>(arguments.size()), arguments.data(),
                         [&](const stymo::CommonOptions&) {
                             for (const auto& [name, value] : line.settings())
                                 settings[name] = nlohmann::json::parse(value.text());
                             return stymo::AppResult{};
                         }) == 0);
        return settings;
    };
    const std::string here = std::filesystem::current_path().string();
    CHECK(settings_with({"--jobs", "2", "--threads", "1"}) ==
          nlohmann::json{{"--matmul-precision", "high"},
                         {"--seed", 0},
                         {"--image", ""},
                         {"--weights", "random"},
                         {"--samples", "default"},
                         {"--rate", 0.5},
                         {"--fit", false}});
    CHECK(settings_with({"-i", "a.png", "--weights", "w", "--samples", "4", "--rate", "0.250",
                         "--fit", "--seed", "7", "--matmul-precision", "highest"}) ==
          nlohmann::json{{"--matmul-precision", "highest"},
                         {"--seed", 7},
                         {"--image", here + "/a.png"},
                         {"--weights", here + "/w"},
                         {"--samples", 4},
                         {"--rate", 0.25},
                         {"--fit", true}});
}

TEST_CASE("A tool that succeeds prints its text and exits with 0") {
    TinyTool tool;
    const Outcome outcome =
        tool.run({"--image", "my photo.png", "--yaw", "-30", "--set", "a.b=1", "--set", "c=x y",
                  "--depth", "--threads", "1", "--seed", "18446744073709551615"});
    CHECK(outcome.exit_code == 0);
    CHECK(outcome.out == "all is well\n");
    CHECK(outcome.err.empty());
    CHECK(tool.image == "my photo.png");
    CHECK(tool.folder == "out");
    CHECK(tool.yaw == -30.0);
    CHECK(tool.assignments == std::vector<std::string>{"a.b=1", "c=x y"});
    CHECK(tool.depth);
    CHECK(tool.common.threads == 1);
    CHECK(tool.common.seed == 18446744073709551615ULL);
}

TEST_CASE("A precision that the processor cannot compute is named, if it was asked for") {
    for (const auto precision : {stymo::MatmulPrecision::high, stymo::MatmulPrecision::medium}) {
        const char* const name = stymo::name_of(precision);
        const Outcome outcome = TinyTool().run({"--image", "x.png", "--matmul-precision", name});
        CHECK(outcome.exit_code == 0);
        CHECK(outcome.err.empty() == (stymo::computed_precision(precision) == precision));
        if (!outcome.err.empty())
            CHECK(outcome.err == std::string("stymo-tiny: warning: this processor has no ") +
                                     "instructions for --matmul-precision " + name +
                                     ", which computes in float32\n");
    }
    CHECK(TinyTool().run({"--image", "x.png", "--matmul-precision", "highest"}).err.empty());
}

TEST_CASE("With --json a tool prints exactly one JSON object") {
    const Outcome outcome = TinyTool().run({"--image", "x.png", "--json", "--steps", "7"});
    CHECK(outcome.exit_code == 0);
    CHECK(nlohmann::json::parse(outcome.out) == nlohmann::json{{"steps", 7}});
}

TEST_CASE(
    "A tool that fails prints one line that begins with its name, nothing else, and exits with 1") {
    const Outcome outcome = TinyTool().run({"--image", "x.png", "--json"},
                                           "x.png: no such file;\ngive another --image\n");
    CHECK(outcome.exit_code == 1);
    CHECK(outcome.out.empty());
    CHECK(outcome.err == "stymo-tiny: x.png: no such file; give another --image\n");
}

TEST_CASE(
    "A result that is only a part is printed, with why on stderr, and the tool exits with 1") {
    stymo::CommandLine line("stymo-tiny", "A tool of the tests.");
    const char* const arguments[] = {"stymo-tiny", "--json"};
    std::ostringstream out;
    std::ostringstream err;
    const auto body = [](const stymo::CommonOptions&) {
        return stymo::AppResult{"half", stymo::JsonValue::object({{"steps", 3}}),
                                "interrupted after 3 of 7 steps"};
    };
    CHECK(line.run(2, arguments, body, out, err) == 1);
    CHECK(nlohmann::json::parse(out.str()) == nlohmann::json{{"steps", 3}});
    CHECK(err.str() == "stymo-tiny: interrupted after 3 of 7 steps\n");
}

TEST_CASE("Wrong usage names the option, points to the help and exits with 2") {
    const auto [arguments, culprit] = GENERATE(table<std::vector<const char*>, std::string>({
        {std::vector<const char*>{}, "--image"},
        {{"--image", "x.png", "--depht"}, "--depht"},
        {{"--image", "x.png", "surplus"}, "surplus"},
        {{"--image", "x.png", "--steps", "many"}, "--steps"},
        {{"--image", "x.png", "--steps", "2000"}, "--steps"},
        {{"--image", "x.png", "--mode", "fast"}, "--mode"},
        {{"--image", "x.png", "--steps", "nan"}, "--steps"},
        {{"--image", "x.png", "--threads", "-1"}, "--threads"},
        {{"--image", "x.png", "--seed", "-1"}, "--seed"},
        {{"--image", ""}, "--image"},
        {{"--image"}, "--image"},
    }));
    const Outcome outcome = TinyTool().run(arguments);
    CHECK(outcome.exit_code == 2);
    CHECK(outcome.out.empty());
    CHECK(outcome.err.find("stymo-tiny: ") == 0);
    CHECK_THAT(outcome.err, Catch::Contains(culprit) && Catch::EndsWith("see stymo-tiny --help\n"));
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
}

TEST_CASE("A body that finds the options wrong ends the tool with 2") {
    stymo::CommandLine line("stymo-tiny", "A tool of the tests.");
    const char* const arguments[] = {"stymo-tiny"};
    std::ostringstream out;
    std::ostringstream err;
    const auto body = [](const stymo::CommonOptions&) -> stymo::AppResult {
        stymo::fail<stymo::UsageError>("--a needs --b");
    };
    CHECK(line.run(1, arguments, body, out, err) == 2);
    CHECK(err.str() == "stymo-tiny: --a needs --b; see stymo-tiny --help\n");
    CHECK(out.str().empty());
}

TEST_CASE("--help and --version go to the standard output and need no other option") {
    const Outcome help = TinyTool().run({"--help"});
    CHECK(help.exit_code == 0);
    for (const char* option : {"--image", "--steps", "--threads", "--seed", "--json", "--version"})
        CHECK_THAT(help.out, Catch::Contains(option));
    const Outcome version = TinyTool().run({"--version"});
    CHECK(version.exit_code == 0);
    CHECK_THAT(version.out, Catch::StartsWith("stymo-tiny ") && Catch::Contains("threads"));
    CHECK(version.err.empty());
}

TEST_CASE("A tool with commands calls the body of the command that was given") {
    const auto run = [](std::vector<const char*> arguments) {
        stymo::CommandLine line("stymo-tiny", "A tool of the tests.");
        double strength = 1.0;
        stymo::Command mix = line.command("mix", "Mixes", [&](const stymo::CommonOptions& common) {
            return stymo::AppResult{
                "mix " + std::to_string(strength) + (common.json ? " json" : ""),
                stymo::JsonValue::object()};
        });
        mix.option("--strength", strength, "Strength");
        line.command("color", "Colours", [](const stymo::CommonOptions&) {
            return stymo::AppResult{"color", {}};
        });
        arguments.insert(arguments.begin(), "stymo-tiny");
        std::ostringstream out;
        std::ostringstream err;
        const int exit_code =
            line.run(static_cast<int>(arguments.size()), arguments.data(), {}, out, err);
        return Outcome{exit_code, out.str(), err.str()};
    };
    CHECK(run({"mix", "--strength", "0.5"}).out == "mix 0.500000\n");
    CHECK(run({"mix", "--json"}).out == "{}\n");
    CHECK(run({"color"}).out == "color\n");
    CHECK(run({"color", "--strength", "1"}).exit_code == 2);
    CHECK(run({}).exit_code == 2);
    CHECK(run({"mix", "color"}).exit_code == 2);
}

TEST_CASE("a message is one line of printable characters, whatever a file is called") {
    CHECK(stymo::one_line("a\nb\r\x1b[31m\t\x7f c\n ") == "a b??[31m?? c");
    CHECK(stymo::one_line("Z\xc3\xbcrich") == "Z\xc3\xbcrich");
}
