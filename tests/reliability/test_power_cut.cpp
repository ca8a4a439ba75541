// Power cuts at every moment of a training, a preparation, a fit and an evaluation.
#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "apps/tiny_run.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "reliability/crash_states.h"
#include "reliability/preloaded_tool.h"

namespace {

namespace fs = std::filesystem;
using namespace stymo;
using nlohmann::json;

/// What a tool wrote below `disk`, and whether it succeeded.
std::vector<Operation> recorded(const fs::path& disk, const std::string& command) {
    const TemporaryFile log;
    const ToolOutcome outcome = run_preloaded(
        "write_recorder",
        {{"STYMO_RECORD_FOLDER", fs::canonical(disk)}, {"STYMO_RECORD_LOG", log.path()}},
        tiny_run(), command);
    INFO(command << "\n" << outcome.err);
    REQUIRE(outcome.exit_code == 0);
    return read_operation_log(log.path());
}

std::vector<std::string> whole_lines(const DiskState& state, const std::string& path) {
    std::vector<std::string> lines;
    const auto file = state.find(path);
    if (file == state.end()) return lines;
    std::istringstream text(file->second.bytes());
    for (std::string line; std::getline(text, line) && !text.eof();) lines.push_back(line);
    return lines;
}

/// Whether files are complete versions.
class Judge {
public:
    explicit Judge(const std::vector<Operation>& operations)
        : versions_(whole_versions(operations)) {}
    [[nodiscard]] bool intact(const DiskState& state, const std::string& path) const {
        const auto file = state.find(path);
        const auto versions = versions_.find(fs::path(path).filename());
        return file != state.end() && versions != versions_.end() &&
               versions->second.contains(file->second.identity());
    }
    [[nodiscard]] bool absent_or_intact(const DiskState& state, const std::string& path) const {
        return !state.contains(path) || intact(state, path);
    }

private:
    WholeVersions versions_;
};

using Check = std::function<bool(const DiskState&, std::size_t promises)>;

/// Looks at all power cuts and returns the number of states that `is_fine` denies.
std::int64_t damaged(const char* title, const std::vector<Operation>& operations,
                     const PowerCuts& cuts, const Check& is_fine) {
    std::int64_t bad = 0;
    const PowerCutCounts counts =
        visit_crash_states(operations, cuts, [&](const DiskState& state, std::size_t promises) {
            bad += is_fine(state, promises) ? 0 : 1;
        });
    std::cout << title << ": " << operations.size() << " operations, " << counts.cuts
              << " power cuts, " << counts.states << " distinct states, " << bad << " damaged\n";
    return bad;
}

bool is_temporary(const std::string& path) {
    return fs::path(path).filename().string().starts_with('.');
}

// ---- Training --------------------------------------------------------------------------------

constexpr const char* train =
    "stymo-train --config tiny.json --data faces --set stage1.steps=5 --set data.split.val=1 --set "
    "output.checkpoint_steps=1 --set output.keep_last=2 ";

/// What resuming reads.
bool counts_for_training(const std::string& path) {
    return !is_temporary(path) && !path.starts_with("run/samples") &&
           !path.starts_with("run/events") && path != "run/log.txt";
}

/// Training promises a checkpoint once the folder is flushed in which `latest` was renamed.
std::vector<std::size_t> promised_checkpoints(const std::vector<Operation>& operations) {
    std::vector<std::size_t> moments;
    for (std::size_t i = 0; i < operations.size(); ++i)
        if (operations[i].kind == Operation::Kind::rename && operations[i].target == "run/latest")
            moments.push_back(i + 2);
    return moments;
}

std::int64_t latest_step(const DiskState& state) {
    const auto latest = state.find("run/latest");
    if (latest == state.end()) return 0;
    const std::string text = latest->second.bytes();
    return text.size() == 7 ? std::atoll(text.c_str()) : -1;
}

/// `latest` names a complete checkpoint, not older than promised, with the statistics up to it;
/// every other checkpoint that has its final name is complete, too.
bool can_resume(const Judge& judge, const DiskState& state, std::size_t promises) {
    const std::int64_t step = latest_step(state);
    if (step < static_cast<std::int64_t>(promises)) return false;
    for (const char* file : {"run/config.json", "run/model.safetensors", "run/best.safetensors"})
        if (!judge.absent_or_intact(state, file)) return false;
    std::set<std::string> folders;
    for (const auto& [path, version] : state)
        if (path.starts_with("run/checkpoints/") && path.find('.') == path.rfind('.'))
            folders.insert(fs::path(path).parent_path());
    for (const std::string& folder : folders)
        for (const char* file : {"/model.safetensors", "/state.safetensors"})
            if (!judge.intact(state, folder + file)) return false;
    if (step == 0) return true;
    char name[32];
    std::snprintf(name, sizeof name, "run/checkpoints/%06d", static_cast<int>(step));
    if (!folders.contains(name)) return false;
    const std::vector<std::string> lines = whole_lines(state, "run/stats.jsonl");
    for (std::int64_t i = 0; i < step; ++i)
        if (i >= std::ssize(lines) ||
            !lines[static_cast<std::size_t>(i)].starts_with("{\"step\":" + std::to_string(i + 1)))
            return false;
    return true;
}

/// Trains to the end from a state and compares with a run that was never interrupted.
void check_resumed(const DiskState& state, const fs::path& expected) {
    const ScratchFolder disk;
    restore(state, disk.path());
    const std::string out = " --out " + (disk / "run").string();
    const ToolOutcome outcome = run_tool(
        tiny_run(), train + out + (state.contains("run/latest") ? " --resume latest" : ""));
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    for (const char* file :
         {"model.safetensors", "best.safetensors", "latest", "checkpoints/000005/model.safetensors",
          "checkpoints/000005/state.safetensors"}) {
        INFO(file);
        CHECK(read_file(disk / "run" / file) == read_file(expected / file));
    }
    CHECK(line_count(read_file(disk / "run/stats.jsonl")) == 5);
}

// ---- Preparing, fitting, measuring -------------------------------------------------------------

/// The end of the program promises everything.
PowerCuts all_at_the_end(const std::vector<Operation>& operations) {
    return {[](const std::string& path) { return !is_temporary(path); }, {operations.size()}};
}

bool has_images(const Judge& judge, const DiskState& state, const json& face) {
    const std::string id = face.is_object() ? face.value("id", "") : "";
    return judge.intact(state, "out/images/" + id + ".png") &&
           judge.intact(state, "out/masks/" + id + ".png");
}

/// Photos that are noted as done have their images; a list of faces is complete.
bool can_go_on(const Judge& judge, const DiskState& state, std::size_t promises) {
    const std::vector<std::string> notes = whole_lines(state, "out/progress.jsonl");
    for (const std::string& note : notes) {
        const json photo = json::parse(note, nullptr, false);
        if (!photo.is_object()) return false;
        for (const json& face : photo.value("faces", json::array()))
            if (!has_images(judge, state, face.value("face", json()))) return false;
    }
    if (promises > 0 && !state.contains("out/faces.jsonl")) return false;
    for (const char* file : {"out/faces.jsonl", "out/camera.json", "out/report.json"}) {
        if (!judge.absent_or_intact(state, file)) return false;
        if (promises > 0 && !state.contains(file)) return false;
    }
    const std::vector<std::string> faces = whole_lines(state, "out/faces.jsonl");
    return std::ranges::all_of(faces, [&](const std::string& line) {
        return has_images(judge, state, json::parse(line, nullptr, false));
    });
}

/// Prepares to the end from a state and compares with a preparation that was never interrupted.
void check_prepared(const DiskState& state, const fs::path& expected, const std::string& command) {
    const ScratchFolder disk;
    restore(state, disk.path());
    const ToolOutcome outcome = run_tool(tiny_run(), command + (disk / "out").string());
    INFO(outcome.err);
    REQUIRE(outcome.exit_code == 0);
    for (const auto& entry : fs::recursive_directory_iterator(expected)) {
        if (!entry.is_regular_file()) continue;
        const fs::path place = disk / "out" / entry.path().lexically_relative(expected);
        INFO(place);
        CHECK(read_file(place) == read_file(entry.path()));
    }
}

}  // namespace

TEST_CASE(
    "after a power cut at any moment training goes on from its newest checkpoint, with the "
    "same bits",
    "[slow]") {
    const ScratchFolder disk;
    const std::vector<Operation> operations =
        recorded(disk.path(), train + (" --out " + (disk / "run").string()));
    const Judge judge(operations);
    const PowerCuts cuts{counts_for_training, promised_checkpoints(operations)};
    REQUIRE(cuts.promises.size() == 5);
    // One state for each set of files and newest checkpoint.
    std::map<std::string, DiskState> survivors;
    const std::int64_t bad =
        damaged("training", operations, cuts, [&](const DiskState& state, std::size_t promises) {
            const bool fine = can_resume(judge, state, promises);
            std::string key = std::to_string(latest_step(state));
            for (const auto& [path, version] : state) key += " " + path;
            if (fine) survivors.emplace(key, state);
            return fine;
        });
    CHECK(bad == 0);
    for (const auto& [key, state] : survivors) {
        INFO(key);
        check_resumed(state, disk / "run");
    }
    std::cout << "resumed from " << survivors.size() << " of them to the same bits\n";
    CHECK(survivors.size() >= 5);

    CHECK(damaged("training, had it flushed nothing", without_flushes(operations), cuts,
                  [&](const DiskState& state, std::size_t promises) {
                      return can_resume(judge, state, promises);
                  }) > 1000);
}

TEST_CASE("after a power cut at any moment a preparation goes on, with the same files", "[slow]") {
    const std::string prepare = "stymo-prep --photos faces --size 64 --out ";
    const ScratchFolder disk;
    const std::vector<Operation> operations =
        recorded(disk.path(), prepare + (disk / "out").string());
    const Judge judge(operations);
    const PowerCuts cuts = all_at_the_end(operations);
    std::map<std::string, DiskState> survivors;
    CHECK(
        damaged("preparation", operations, cuts, [&](const DiskState& state, std::size_t promises) {
            const bool going_on = state.contains("out/settings.json");
            const std::size_t notes = whole_lines(state, "out/progress.jsonl").size();
            if (going_on)
                survivors.emplace(
                    std::to_string(notes) + " " + std::to_string(state.contains("out/faces.jsonl")),
                    state);
            return can_go_on(judge, state, promises);
        }) == 0);
    for (const auto& [key, state] : survivors) {
        INFO(key);
        check_prepared(state, disk / "out", prepare);
    }
    std::cout << "continued from " << survivors.size() << " of them to the same files\n";
    CHECK(survivors.size() >= 12);
    CHECK(damaged("preparation, had it flushed nothing", without_flushes(operations), cuts,
                  [&](const DiskState& state, std::size_t promises) {
                      return can_go_on(judge, state, promises);
                  }) > 100);
}

TEST_CASE("after a power cut a fit's codes and tuned weights are whole or not there", "[slow]") {
    const ScratchFolder disk;
    const std::vector<Operation> operations =
        recorded(disk.path(),
                 "stymo-fit --model run/model.safetensors --data faces --id 00011 --steps 3 "
                 "--tune-steps 2 --out " +
                     (disk / "out").string());
    const auto is_fine = [judge = Judge(operations)](const DiskState& state, std::size_t promises) {
        for (const char* file : {"out/codes.json", "out/tuned.safetensors"}) {
            if (!judge.absent_or_intact(state, file)) return false;
            if (promises > 0 && !state.contains(file)) return false;
        }
        return true;
    };
    const PowerCuts cuts = all_at_the_end(operations);
    CHECK(damaged("fit", operations, cuts, is_fine) == 0);
    CHECK(damaged("fit, had it flushed nothing", without_flushes(operations), cuts, is_fine) > 100);
}

TEST_CASE("after a power cut an evaluation has the codes of every face that is scored", "[slow]") {
    const ScratchFolder disk;
    const std::vector<Operation> operations =
        recorded(disk.path(),
                 "stymo-eval --model run/model.safetensors --data faces --fit --steps 1 "
                 "--perceptual-weight 0 --out " +
                     (disk / "out").string());
    const auto is_fine = [judge = Judge(operations)](const DiskState& state, std::size_t promises) {
        const std::vector<std::string> scores = whole_lines(state, "out/scores.jsonl");
        if (!judge.absent_or_intact(state, "out/settings.json")) return false;
        if (promises > 0 && scores.empty()) return false;
        return std::ranges::all_of(scores, [&](const std::string& line) {
            const json score = json::parse(line, nullptr, false);
            return score.is_object() && judge.intact(state, "out/settings.json") &&
                   judge.intact(state, "out/codes/" + score.value("id", "") + ".json");
        });
    };
    const PowerCuts cuts = all_at_the_end(operations);
    CHECK(damaged("evaluation", operations, cuts, is_fine) == 0);
    CHECK(damaged("evaluation, had it flushed nothing", without_flushes(operations), cuts,
                  is_fine) > 100);
}
