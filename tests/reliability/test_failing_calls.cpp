// Calls of the system that fail one after the other, and limits of the system.
#include <sys/resource.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "apps/tiny_run.h"
#include "core/io/file.h"
#include "core/io/scratch_folder.h"
#include "reliability/two_stages.h"

namespace {

using namespace stymo;
namespace fs = std::filesystem;

struct Call {
    const char* name;
    int error;
};

constexpr Call calls[] = {{"write", ENOSPC}, {"flush", EIO}, {"open", EMFILE},
                          {"rename", EIO},   {"read", EIO},  {"allocate", ENOMEM}};

/// A tool whose calls are to fail.
struct Job {
    std::string command;  ///< ends with the option of the output folder
    /// Runs the tool again on its output folder and compares with an undisturbed run.
    std::function<void(const fs::path& out)> finish;
};

/// STYMO_CALLS, or 8: how many calls of each kind fail; 0: all.
long calls_to_fail() {
    const char* const text = std::getenv("STYMO_CALLS");
    return text == nullptr ? 8 : std::atol(text);
}

ToolOutcome disturbed(const Job& job, const fs::path& out, const Call& call, long at, bool ever,
                      long* count = nullptr) {
    const TemporaryFile counted;
    // Folders of this name hold what is read and written, but not the tool's stdout and stderr.
    Environment environment{
        {"STYMO_FAIL_PATH", fs::canonical(fs::temp_directory_path()) / "stymo-test-"},
        {"STYMO_FAIL_CALL", call.name},
        {"STYMO_FAIL_AT", std::to_string(at)},
        {"STYMO_FAIL_ERROR", std::to_string(call.error)},
        {"STYMO_FAIL_COUNT", counted.path()}};
    if (ever) environment.emplace_back("STYMO_FAIL_EVER", "1");
    ToolOutcome outcome =
        run_preloaded("failing_calls", environment, tiny_run(), job.command + out.string());
    if (count != nullptr) *count = std::atol(read_text_file(counted.path()).c_str());
    return outcome;
}

/// The failure is one line, behind the lines of progress, and names the tool.
void check_says_so(const std::string& command, const ToolOutcome& outcome) {
    const std::string start = words(command).front() + ": ";
    std::string text = outcome.err;
    INFO(text);
    CHECK(outcome.exit_code == 1);
    REQUIRE(text.ends_with('\n'));
    text.pop_back();
    const std::size_t line = text.rfind('\n') == std::string::npos ? 0 : text.rfind('\n') + 1;
    CHECK(text.substr(line).starts_with(start));
    CHECK(text.find(start) == line);
    CHECK(outcome.out.empty());
}

bool has_temporary_files(const fs::path& folder) {
    if (!fs::exists(folder)) return false;
    return std::ranges::any_of(fs::recursive_directory_iterator(folder), [](const auto& entry) {
        return entry.path().filename().string().find(".part") != std::string::npos;
    });
}

void check_disturbed(const Job& job, const Call& call, long at, bool ever) {
    const ScratchFolder disk;
    const fs::path out = disk / "out";
    const ToolOutcome outcome = disturbed(job, out, call, at, ever);
    INFO(job.command << ": " << call.name << " " << at << (ever ? " and all after it" : ""));
    // A photo that cannot be read is left out, as a broken one is, and the tool says so.
    const bool photo = (outcome.err + outcome.out).find("faces/images/") != std::string::npos ||
                       outcome.err.find("faces/masks/") != std::string::npos;
    if (outcome.exit_code == 0 && photo) return;
    if (outcome.exit_code != 0) check_says_so(job.command, outcome);
    CHECK_FALSE(has_temporary_files(out));
    job.finish(out);
}

void fail_each(const Job& job) {
    for (const Call& call : calls) {
        const ScratchFolder disk;
        long count = 0;
        const ToolOutcome outcome = disturbed(job, disk / "out", call, 0, false, &count);
        REQUIRE(outcome.exit_code == 0);
        const long most = calls_to_fail() > 0 ? calls_to_fail() : count;
        const long step = std::max(1L, count / most);
        long failed = 0;
        for (long at = 1; at <= count; at += step, ++failed) check_disturbed(job, call, at, false);
        if (std::string(call.name) == "write")
            for (long at = 1; at <= count; at += 2 * step, ++failed)
                check_disturbed(job, call, at, true);
        std::cout << words(job.command).front() << ": " << failed << " of " << count << " calls of "
                  << call.name << " failed\n";
    }
}

Job training() {
    static_cast<void>(two_stage_run());
    return {two_stages, check_finishes};
}

/// Runs a job to its end in `out` and compares these files.
std::function<void(const fs::path&)> same_files(const std::string& command,
                                                std::vector<std::string> files) {
    const auto expected = std::make_shared<const ScratchFolder>();
    const fs::path whole = *expected / "whole";
    const ToolOutcome outcome = run_tool(tiny_run(), command + whole.string());
    if (outcome.exit_code != 0) throw std::runtime_error(outcome.err);
    return [command, files, expected, whole](const fs::path& out) {
        const ToolOutcome again = run_tool(tiny_run(), command + out.string());
        INFO(again.err);
        const bool complete = again.err.find("exists already") != std::string::npos;
        CHECK((again.exit_code == 0 || complete));
        for (const std::string& file : files) {
            INFO(file);
            CHECK(read_text_file(out / file) == read_text_file(whole / file));
        }
    };
}

Job fitting() {
    const std::string command =
        "stymo-fit --model run/model.safetensors --data faces --id 00011 --steps 3 --tune-steps 2 "
        "--out ";
    return {command, same_files(command, {"codes.json", "tuned.safetensors", "fit.png"})};
}

Job preparation() {
    const std::string command = "stymo-prep --photos faces --size 64 --out ";
    return {command, same_files(command, {"faces.jsonl", "camera.json", "images/00011.png"})};
}

/// While it lives, a resource of this process and those it starts is limited.
class Limit {
public:
    Limit(__rlimit_resource resource, rlim_t most) : resource_(resource) {
        ::getrlimit(resource_, &former_);
        const rlimit limit{most, former_.rlim_max};
        ::setrlimit(resource_, &limit);
    }
    ~Limit() { ::setrlimit(resource_, &former_); }
    Limit(const Limit&) = delete;
    Limit& operator=(const Limit&) = delete;

private:
    __rlimit_resource resource_;
    rlimit former_{};
};

void check_limited(const Job& job, __rlimit_resource resource, rlim_t most) {
    const ScratchFolder disk;
    const fs::path out = disk / "out";
    std::vector<std::string> arguments = words(job.command + out.string());
    const std::string tool = arguments.front();
    arguments.erase(arguments.begin());
    ToolOutcome outcome;
    {
        std::optional<Limit> limit(std::in_place, resource, most);
        RunningTool running(tiny_run(), tool, arguments);
        limit.reset();
        outcome = running.wait();
    }
    INFO(job.command << ": limit " << most);
    if (outcome.exit_code != 0) check_says_so(job.command, outcome);
    CHECK_FALSE(has_temporary_files(out));
    job.finish(out);
}

}  // namespace

TEST_CASE("whichever call fails, training says so, and goes on with the same bits", "[slow]") {
    fail_each(training());
}

TEST_CASE("whichever call fails, a fit says so and leaves nothing half-written", "[slow]") {
    fail_each(fitting());
}

TEST_CASE("whichever call fails, a preparation says so, and goes on with the same files",
          "[slow]") {
    fail_each(preparation());
}

TEST_CASE("a file system that is read-only is an error of one line", "[slow]") {
    // Permissions would not keep a test that runs as root from writing.
    for (const Job& job : {training(), fitting(), preparation()}) {
        const ScratchFolder disk;
        fs::create_directory(disk / "out");
        for (const fs::path& out : {disk / "out", disk / "new"}) {
            INFO(job.command << out);
            const ToolOutcome outcome = disturbed(job, out, {"create", EROFS}, 1, true);
            INFO(outcome.err);
            check_says_so(job.command, outcome);
            CHECK_THAT(outcome.err, Catch::Contains("Read-only file system"));
            CHECK_THAT(outcome.err, !Catch::Contains("%"));  // before the work
            CHECK((!fs::exists(out) || fs::is_empty(out)));
        }
    }
}

TEST_CASE("files that may not grow and too few open files are errors of one line", "[slow]") {
    for (const Job& job : {training(), fitting(), preparation()}) {
        // The tool's own messages go to a file too, so the least limit leaves room for them.
        for (const rlim_t bytes : {4000, 10000, 1000000}) check_limited(job, RLIMIT_FSIZE, bytes);
        for (const rlim_t files : {4, 5, 6, 8}) check_limited(job, RLIMIT_NOFILE, files);
    }
}
