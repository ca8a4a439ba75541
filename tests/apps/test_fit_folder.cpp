// stymo-fit on a folder of photos, played by rendered heads; and folders that ranks divide.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/tiny_run.h"
#include "apps/tool_run.h"
#include "core/io/file.h"
#include "fit/photo/face_detector.h"

namespace fit_folder_tests {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using stymo::run_tool;
using stymo::tiny_run;
using stymo::ToolOutcome;

constexpr int head_count = 3;
const std::string model = " --model run/model.safetensors --steps 2 --depth-weight 0 ";

/// Rendered heads that are large enough to be found, and a file that is no image.
bool can_run() {
    if (!stymo::FaceDetector::available()) {
        std::cout << "skipped: built without dlib\n";
        return false;
    }
    if (fs::exists(tiny_run() / "portraits")) return true;
    REQUIRE(run_tool(tiny_run(), "stymo-synth --out heads --count 3 --size 256").exit_code == 0);
    fs::rename(tiny_run() / "heads/images", tiny_run() / "portraits");
    stymo::write_file(tiny_run() / "portraits/broken.png", "no image\n");
    return true;
}

ToolOutcome fit(const std::string& more) {
    return run_tool(tiny_run(), "stymo-fit --images portraits" + model + more);
}

std::string bytes(const std::string& file) {
    return stymo::read_file(tiny_run() / file);
}

/// The files of a finished output by name, without those that hold times.
std::map<std::string, std::string> results_in(const fs::path& folder, bool fitted) {
    std::map<std::string, std::string> results;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
        const std::string name = entry.path().lexically_relative(folder);
        if (entry.is_regular_file() && name != ".lock" && !(fitted && name == "report.json"))
            results[name] = stymo::read_file(entry.path());
    }
    return results;
}

}  // namespace

TEST_CASE("A folder of photos is fitted photo by photo, and a stopped run goes on") {
    if (!can_run()) return;
    const ToolOutcome whole = fit("--out folder_fit --json");
    INFO(whole.err);
    REQUIRE(whole.exit_code == 0);
    const json report = json::parse(whole.out);
    CHECK(report["found"] == head_count + 1);
    CHECK(report["fitted"] == head_count);
    CHECK(report["failed"][0]["file"] == "broken.png");
    CHECK(report["photos_a_minute"].get<double>() > 0.0);
    const std::string lines = bytes("folder_fit/faces.jsonl");
    CHECK(stymo::line_count(lines) == head_count + 1);
    const json first = json::parse(lines.substr(0, lines.find('\n')));
    CHECK(first["file"] == "00000.png");
    CHECK(first["code"] == json::parse(bytes("folder_fit/codes/00000.json"))["code"]);
    CHECK(fs::exists(tiny_run() / "folder_fit/fits/00000.jpg"));

    // What a rank leaves that dies in the middle of a line.
    fs::create_directory(tiny_run() / "torn");
    fs::copy(tiny_run() / "folder_fit/settings.json", tiny_run() / "torn/settings.json");
    const std::size_t end = lines.find('\n', lines.find('\n') + 1) + 1;
    stymo::write_file(tiny_run() / "torn/faces.1.jsonl", lines.substr(0, end + 20));
    const ToolOutcome again = fit("--out torn");
    CHECK(again.exit_code == 0);
    CHECK_THAT(again.out, Catch::Contains("3 of 4 photos fitted"));
    CHECK(bytes("torn/faces.jsonl") == lines);
    CHECK_FALSE(fs::exists(tiny_run() / "torn/faces.1.jsonl"));
    CHECK_FALSE(fs::exists(tiny_run() / "torn/codes/00000.json"));  // it was not fitted again

    CHECK_THAT(fit("--out folder_fit --tolerance 0.5").err,
               Catch::Contains("was begun with other settings (--tolerance was 0.001, now 0.5)"));
}

TEST_CASE("Folders that cannot be fitted are refused, and nothing is written") {
    if (!can_run()) return;
    const auto refused = [](const std::string& command, const std::string& words) {
        const ToolOutcome outcome = run_tool(tiny_run(), command);
        CHECK(outcome.exit_code != 0);
        CHECK_THAT(outcome.err, Catch::Contains(words));
        CHECK_FALSE(fs::exists(tiny_run() / "refused"));
    };
    refused("stymo-fit --images empty --out refused" + model, "empty: no images");
    refused("stymo-fit --images portraits --as-is --out refused" + model, "leave out --image");
    refused("stymo-fit --images portraits --out faces" + model, "faces: exists already");
    fs::create_directory(tiny_run() / "no_faces");
    fs::copy(tiny_run() / "portraits/broken.png", tiny_run() / "no_faces/broken.png");
    refused("stymo-fit --images no_faces --out refused" + model,
            "none of its 1 photos can be used; the first: broken.png: not an image");
}

TEST_CASE("What was fitted stays when photos are taken out of the folder") {
    if (!can_run()) return;
    const fs::path album = tiny_run() / "album";
    fs::create_directory(album);
    const std::string command = "stymo-fit --images album --out album_fit" + model;
    fs::copy(tiny_run() / "portraits/00000.png", album / "00000.png");
    REQUIRE(run_tool(tiny_run(), command).exit_code == 0);
    const std::string first = bytes("album_fit/faces.jsonl");

    fs::remove(album / "00000.png");
    fs::copy(tiny_run() / "portraits/broken.png", album / "broken.png");
    const ToolOutcome unusable = run_tool(tiny_run(), command);
    CHECK(unusable.exit_code == 1);
    CHECK_THAT(unusable.err, Catch::Contains("none of its 1 photos can be used"));
    CHECK_THAT(bytes("album_fit/faces.jsonl"), Catch::EndsWith(first));

    fs::copy(tiny_run() / "portraits/00001.png", album / "00001.png");
    const ToolOutcome more = run_tool(tiny_run(), command);
    INFO(more.err);
    CHECK(more.exit_code == 0);
    CHECK_THAT(bytes("album_fit/faces.jsonl"), Catch::EndsWith(first));
    CHECK(stymo::line_count(bytes("album_fit/faces.jsonl")) == 3);
}

TEST_CASE("Two ranks write the files of one process, and one that is killed loses no photo",
          "[slow]") {
    if (!stymo::can_start_ranks()) return;
    std::vector<std::string> commands{
        "stymo-prep --photos faces --size 32 --out ",
        "stymo-eval --data faces --fit --perceptual-weight 0 --steps 2 --model "
        "run/model.safetensors --out "};
    if (can_run()) commands.push_back("stymo-fit --images portraits" + model + "--out ");
    for (const std::string& command : commands) {
        INFO(command);
        const bool fits = command.starts_with("stymo-fit");
        const std::string name = "by_ranks" + command.substr(0, command.find(' '));
        const fs::path out = tiny_run() / name;
        REQUIRE(run_tool(tiny_run(), command + name + "_alone").exit_code == 0);
        const auto alone = results_in(out.string() + "_alone", fits);
        CHECK(alone.size() > 3);
        const std::vector<std::string> words =
            stymo::words("mpirun --oversubscribe -n 2 --wdir " + tiny_run().string() +
                         " " STYMO_BINARY_DIR "/bin/" + command + name + " --threads 1");
        const stymo::ChildOutcome both = stymo::run_ranks(words);
        INFO(both.err);
        REQUIRE(both.exit_code == 0);
        CHECK(results_in(out, fits) == alone);

        // The ranks are killed when the first has finished a photo.
        fs::remove_all(out);
        std::vector<std::string> killed = words;
        killed.insert(killed.begin(),
                      {"sh", "-c",
                       "\"$@\" & until ls " + out.string() +
                           " 2>/dev/null | grep -q jsonl; do sleep 0.02; kill -0 $! || break; "
                           "done; pkill -KILL -P $!; wait",
                       "sh"});
        static_cast<void>(stymo::run_ranks(killed));
        if (fs::exists(out / "settings.json")) REQUIRE(stymo::run_ranks(words).exit_code == 0);
        CHECK(results_in(out, fits) == alone);
    }
}

}  // namespace fit_folder_tests
