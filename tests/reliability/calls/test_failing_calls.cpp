// Calls of the system that fail one after the other, and limits of the system.
#include <sys/resource.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdlib>
#include <iostream>
#include <map>
#include <set>
#include <string>

#include "core/clock.h"
#include "core/io/file.h"
#include "reliability/calls/branches.h"
#include "reliability/calls/short_jobs.h"

namespace {

using namespace stymo;
namespace fs = std::filesystem;

struct Call {
    const char* name;
    CallKind kind;
    int error;
};

constexpr Call calls[] = {
    {"write", CallKind::write, ENOSPC},  {"flush", CallKind::flush, EIO},
    {"open", CallKind::open, EMFILE},    {"rename", CallKind::rename, EIO},
    {"read", CallKind::read, EIO},       {"allocate", CallKind::allocate, ENOMEM}};

std::string setting(const char* name) {
    const char* const text = std::getenv(name);
    return text == nullptr ? "" : text;
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

/// Stands for what a tool finds in its output folder. Left out are the log and the files of
/// TensorBoard, which hold times, and which no tool reads.
std::string digest(const fs::path& folder) {
    std::map<std::string, std::size_t> files;
    if (fs::exists(folder))
        for (const auto& entry : fs::recursive_directory_iterator(folder)) {
            const std::string name = entry.path().lexically_relative(folder).string();
            if (name == "log.txt" || name.starts_with("events.")) continue;
            files[name] = entry.is_regular_file()
                              ? std::hash<std::string>()(read_text_file(entry.path()))
                              : 0;
        }
    std::string text;
    for (const auto& [name, hash] : files) text += name + ' ' + std::to_string(hash) + '\n';
    return text;
}

/// The states of output folders from which a job has been finished, so that none is tried twice.
class FinishedStates {
public:
    /// Finishes the job from what is in its output folder, and compares.
    void finish(const ShortJob& job, const fs::path& out) {
        if (!seen_.insert(digest(out)).second) return;
        const ToolOutcome again = RunningCopy(short_data(), job.command_to_finish(out)).wait();
        INFO("again: " << again.err);
        const bool complete = again.err.find("exists already") != std::string::npos;
        CHECK((again.exit_code == 0 || complete));
        job.compare(out);
    }
    [[nodiscard]] std::size_t count() const { return seen_.size(); }

private:
    std::set<std::string> seen_;
};

/// Failing calls of one kind in one job.
struct Trials {
    const ShortJob& job;
    const Call& call;
    FinishedStates states;
    long failed = 0, survived = 0;

    void check(const Branch& branch) {
        INFO(job.name << ": " << call.name << " " << branch.number
                      << (branch.ever ? " and all after it" : ""));
        const ToolOutcome& outcome = branch.outcome;
        INFO(outcome.err);
        ++failed;
        if (outcome.exit_code == 0) ++survived;
        // A photo that cannot be read is left out, as a broken one is, and the tool says so.
        const bool photo = (outcome.err + outcome.out).find("photos/") != std::string::npos ||
                           outcome.err.find("faces/images/") != std::string::npos ||
                           outcome.err.find("faces/masks/") != std::string::npos;
        if (outcome.exit_code == 0 && photo) return;
        if (outcome.exit_code != 0) check_says_so(job.command, outcome);
        CHECK_FALSE(has_temporary_files(branch.out));
        states.finish(job, branch.out);
    }
};

/// STYMO_CALLS=all: every call fails, not only the first and the last one from each place.
/// STYMO_CALLS_OF=read: only calls of one kind do.
void fail_each(const ShortJob& job) {
    const std::string only = setting("STYMO_CALLS_OF");
    for (const Call& call : calls) {
        if (!only.empty() && only != call.name) continue;
        const double start = seconds_now();
        CallPlaces places;
        const WatchedCalls watched{call.kind, call.error,
                                   fs::canonical(fs::temp_directory_path()) / "stymo-test-"};
        count_calls(job, watched, places);
        Trials trials{job, call, {}};
        fail_in_copies(job, watched, places,
                       setting("STYMO_CALLS") == "all" ? Chosen::all : Chosen::ends,
                       call.kind == CallKind::write,
                       [&](const Branch& branch) { trials.check(branch); });
        CHECK(places.failed() == places.count());
        std::cout << job.name << ", " << call.name << ": " << places.calls() << " calls from "
                  << places.count() << " places; " << trials.failed << " trials, with a failure at "
                  << places.failed() << " of the places; " << trials.survived
                  << " did not matter; " << trials.states.count() << " states of the disk; "
                  << seconds_now() - start << " s" << std::endl;
    }
}

}  // namespace

TEST_CASE("whichever call fails, training says so, and goes on with the same bits", "[slow]") {
    fail_each(training());
}

TEST_CASE("whichever call fails, a resumed training says so, and goes on with the same bits",
          "[slow]") {
    fail_each(resumed_training());
}

TEST_CASE("whichever call fails, a fit says so and leaves nothing half-written", "[slow]") {
    fail_each(fitting());
}

TEST_CASE("whichever call fails, a preparation says so, and goes on with the same files",
          "[slow]") {
    fail_each(preparation());
}
