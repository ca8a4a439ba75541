// Ctrl-C and SIGTERM to the real tools.
#include <algorithm>
#include <catch2/catch.hpp>
#include <csignal>
#include <nlohmann/json.hpp>

#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::RunningTool;
using stymo::tiny_run;
using stymo::ToolOutcome;

/// Starts a command, waits for its first line of progress and sends the signal.
ToolOutcome interrupted(const std::string& command, const std::string& first_words,
                        int signal_number) {
    std::vector<std::string> arguments = stymo::words(command);
    const std::string tool = arguments.front();
    arguments.erase(arguments.begin());
    RunningTool running(tiny_run(), tool, arguments);
    CHECK(running.says(first_words));
    running.send(signal_number);
    return running.wait();
}

/// Files of a killed tool: hidden names with ".part" in them.
bool leftovers() {
    return std::ranges::any_of(fs::directory_iterator(tiny_run()), [](const auto& entry) {
        return entry.path().filename().string().find(".part") != std::string::npos;
    });
}

}  // namespace

TEST_CASE("Training that is interrupted saves a checkpoint first, and goes on from there") {
    const std::string train =
        "stymo-train --config tiny.json --data faces --out stopped --set stage1.steps=100000 ";
    const ToolOutcome first = interrupted(train + "--json", "train ", SIGTERM);
    CHECK(first.exit_code == 0);
    const json outcome = json::parse(first.out);
    CHECK(outcome["finished"] == false);
    const std::string latest = stymo::read_file(tiny_run() / "stopped/latest");
    CHECK(std::stoll(latest) == outcome["steps"].get<std::int64_t>());
    CHECK(fs::exists(tiny_run() / "stopped/model.safetensors"));
    const ToolOutcome second = interrupted(train + "--resume latest", "train ", SIGINT);
    CHECK(second.exit_code == 0);
    CHECK(std::stoll(stymo::read_file(tiny_run() / "stopped/latest")) > std::stoll(latest));
    CHECK_THAT(second.out, Catch::Contains("stopped early"));
}

TEST_CASE("A second run in the folder of one that trains is refused in one line") {
    const std::string train =
        "stymo-train --config tiny.json --data faces --out shared --set stage1.steps=100000";
    std::vector<std::string> arguments = stymo::words(train);
    RunningTool running(tiny_run(), arguments.front(), {arguments.begin() + 1, arguments.end()});
    REQUIRE(running.says("train "));
    for (const char* resume : {"", " --resume latest"}) {
        const ToolOutcome second = stymo::run_tool(tiny_run(), train + resume);
        CHECK(second.exit_code == 1);
        CHECK_THAT(second.err, Catch::EndsWith("stymo-train: shared: another process is working in "
                                               "this folder; wait for it to end or choose another "
                                               "one\n"));
    }
    running.send(SIGTERM);
    CHECK(running.wait().exit_code == 0);
}

TEST_CASE("A fit that is interrupted keeps what it has and says so") {
    const std::string fit =
        "stymo-fit --model run/model.safetensors --image faces/images/00000.png --as-is --out "
        "stopped_fit --steps 1000000 --json";
    const ToolOutcome outcome = interrupted(fit, "fit ", SIGINT);
    CHECK(outcome.exit_code == 1);
    const json report = json::parse(outcome.out);
    const auto steps = report["steps"].get<std::int64_t>();
    CHECK(steps < 1000000);
    CHECK_THAT(outcome.err, Catch::EndsWith("stymo-fit: interrupted after " +
                                            std::to_string(steps) + " of 1000000 steps\n"));
    CHECK(fs::exists(tiny_run() / "stopped_fit/codes.json"));
}

TEST_CASE("A fit that is interrupted leaves an earlier fit in its folder alone") {
    const std::string fit =
        "stymo-fit --model run/model.safetensors --as-is --out kept_fit --image faces/images/";
    const ToolOutcome first =
        stymo::run_tool(tiny_run(), fit + "00000.png --steps 2 --tune-steps 1");
    REQUIRE(first.exit_code == 0);
    const auto bytes = [] {
        std::string all;
        for (const char* name : {"codes.json", "fit.png", "report.json", "tuned.safetensors"})
            all += stymo::read_file(tiny_run() / "kept_fit" / name);
        return all;
    };
    const std::string before = bytes();
    const ToolOutcome second = interrupted(fit + "00001.png --steps 1000000", "fit ", SIGINT);
    CHECK(second.exit_code == 1);
    CHECK_THAT(
        second.err,
        Catch::Contains("warning: kept_fit: the fit that it holds and its tuned weights will "
                        "be replaced\n") &&
            Catch::EndsWith(" of 1000000 steps; the earlier fit in kept_fit stays\n"));
    CHECK(bytes() == before);
}

TEST_CASE(
    "An evaluation that is interrupted gives the scores of the faces it has finished, says so, and "
    "goes on from there") {
    const std::string evaluate =
        "stymo-eval --model run/model.safetensors --data faces --fit --perceptual-weight 0 --steps "
        "30 --out stopped_scores ";
    const ToolOutcome outcome = interrupted(evaluate + "--json", "evaluate ", SIGINT);
    CHECK(outcome.exit_code == 1);
    const auto faces = json::parse(outcome.out)["count"].get<std::int64_t>();
    CHECK(faces >= 1);
    CHECK(faces < 12);
    CHECK_THAT(outcome.err, Catch::Contains("stymo-eval: interrupted after " +
                                            std::to_string(faces) + " of 12 faces"));
    const fs::path out = tiny_run() / "stopped_scores";
    CHECK_FALSE(fs::exists(out / "report.json"));
    const ToolOutcome other = stymo::run_tool(tiny_run(), evaluate + "--samples 4");
    CHECK(other.exit_code == 1);
    CHECK_THAT(other.err,
               Catch::Contains("was begun with other settings (--samples was \"default\", now 4)"));
    CHECK(stymo::line_count(stymo::read_file(out / "scores.jsonl")) == faces);
}

TEST_CASE("What cannot be of use in part is not written when it is interrupted") {
    const ToolOutcome synth =
        interrupted("stymo-synth --out stopped_faces --count 100000 --size 64", "Heads ", SIGTERM);
    CHECK(synth.exit_code == 1);
    CHECK_THAT(synth.err, Catch::Contains("stymo-synth: interrupted; nothing was written\n"));
    CHECK_FALSE(fs::exists(tiny_run() / "stopped_faces"));
    const ToolOutcome orbit = interrupted(
        "stymo-render --model run/model.safetensors --codes fit/codes.json --out stopped.gif "
        "--orbit 10000",
        "render ", SIGINT);
    CHECK(orbit.exit_code == 1);
    CHECK_THAT(orbit.err, Catch::Contains("stymo-render: interrupted; nothing was written\n"));
    CHECK_FALSE(fs::exists(tiny_run() / "stopped.gif"));
    CHECK_FALSE(leftovers());
}
