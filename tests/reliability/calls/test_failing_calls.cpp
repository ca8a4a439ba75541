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
#include <vector>

#include "core/clock.h"
#include "core/io/file.h"
#include "reliability/calls/failing_calls.h"
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

/// A folder for the output of a job, as it is before the tool runs.
class OutputFolder {
public:
    explicit OutputFolder(const ShortJob& job) {
        if (!job.beginning.empty()) fs::copy(job.beginning, path(), fs::copy_options::recursive);
    }
    [[nodiscard]] fs::path path() const { return disk_ / "out"; }

private:
    ScratchFolder disk_;
};

ToolOutcome run_watched(const ShortJob& job, const fs::path& out, CallPlan plan,
                        CallReport& report) {
    plan.place = fs::canonical(fs::temp_directory_path()) / "stymo-test-";
    report.calls = 0;
    report.failed = 0;
    return run_copy(
        short_data(), job.command + out.string(), [&] { watch_calls(plan, report); },
        stop_watching_calls);
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

/// What a tool finds in its output folder. Left out are the log and the files of TensorBoard, which
/// hold times, and which no tool reads.
std::string contents(const fs::path& folder) {
    std::map<std::string, std::string> files;
    if (fs::exists(folder))
        for (const auto& entry : fs::recursive_directory_iterator(folder)) {
            const std::string name = entry.path().lexically_relative(folder).string();
            const bool timed = name == "log.txt" || name.starts_with("events.");
            files[name] = entry.is_regular_file() && !timed ? read_text_file(entry.path()) : "";
        }
    std::string text;
    for (const auto& [name, bytes] : files)
        text += name + ' ' + std::to_string(bytes.size()) + '\n' + bytes;
    return text;
}

/// The states of output folders from which a job has been finished, so that none is tried twice.
class FinishedStates {
public:
    /// Finishes the job from what is in its output folder, and compares.
    void finish(const ShortJob& job, const fs::path& out) {
        if (!seen_.insert(std::hash<std::string>()(contents(out))).second) return;
        const ToolOutcome again = run_copy(short_data(), job.command_to_finish(out));
        INFO("again: " << again.err);
        const bool complete = again.err.find("exists already") != std::string::npos;
        CHECK((again.exit_code == 0 || complete));
        job.compare(out);
    }
    [[nodiscard]] std::size_t count() const { return seen_.size(); }

private:
    std::set<std::size_t> seen_;
};

/// The failing calls of one kind in one job.
class Trials {
public:
    Trials(const ShortJob& job, const Call& call) : job_(job), call_(call) {
        const OutputFolder out(job);
        const ToolOutcome outcome = run_watched(job, out.path(), {.kind = call.kind, .lists = true},
                                                *report_);
        INFO(outcome.err);
        REQUIRE(outcome.exit_code == 0);
        count_ = report_->calls;
        for (const CallPlace& place : report_->places)
            if (place.hash != 0) places_.push_back(place);
    }

    [[nodiscard]] long count() const { return count_; }
    [[nodiscard]] const std::vector<CallPlace>& places() const { return places_; }

    /// The numbers of the first and the last call from each place.
    [[nodiscard]] std::set<long> first_and_last() const {
        std::set<long> numbers;
        for (const CallPlace& place : places_) numbers.insert({place.first, place.last});
        return numbers;
    }

    void fail_at(long number, bool ever) {
        const OutputFolder out(job_);
        const ToolOutcome outcome = run_watched(
            job_, out.path(),
            {.kind = call_.kind, .fails_at = number, .ever = ever, .error = call_.error}, *report_);
        INFO(job_.name << ": " << call_.name << " " << number << (ever ? " and all after it" : ""));
        INFO(outcome.err);
        failed_.insert(report_->failed_at);
        CHECK(report_->failed >= 1);
        ++trials_;
        // A photo that cannot be read is left out, as a broken one is, and the tool says so.
        const bool photo = (outcome.err + outcome.out).find("faces/images/") != std::string::npos ||
                           outcome.err.find("faces/masks/") != std::string::npos;
        if (outcome.exit_code == 0) ++survived_;
        if (outcome.exit_code == 0 && photo) return;
        if (outcome.exit_code != 0) check_says_so(job_.command, outcome);
        CHECK_FALSE(has_temporary_files(out.path()));
        states_.finish(job_, out.path());
    }

    /// The places at which a call has failed.
    [[nodiscard]] long failed_places() const {
        return std::ranges::count_if(places_, [&](const CallPlace& place) {
            return failed_.contains(place.hash);
        });
    }

    void print(double seconds) const {
        std::cout << job_.name << ", " << call_.name << ": " << count_ << " calls from "
                  << places_.size() << " places; " << trials_ << " failed, from " << failed_places()
                  << " of the places; " << survived_ << " did not matter; " << states_.count()
                  << " states of the disk; " << seconds << " s" << std::endl;
    }

private:
    const ShortJob& job_;
    const Call& call_;
    SharedReport report_;
    long count_ = 0;
    std::vector<CallPlace> places_;
    std::set<std::uint64_t> failed_;
    FinishedStates states_;
    long trials_ = 0, survived_ = 0;
};

void fail_each(const ShortJob& job) {
    const std::string only = setting("STYMO_CALLS_OF");
    for (const Call& call : calls) {
        if (!only.empty() && only != call.name) continue;
        const double start = seconds_now();
        Trials trials(job, call);
        const bool all = setting("STYMO_CALLS") == "all";
        std::set<long> numbers = trials.first_and_last();
        if (all && call.kind != CallKind::allocate)
            for (long number = 1; number <= trials.count(); ++number) numbers.insert(number);
        if (setting("STYMO_CALLS") == "list") numbers.clear();
        for (const long number : numbers) trials.fail_at(number, false);
        if (call.kind == CallKind::write)
            for (const long number : numbers) trials.fail_at(number, true);
        trials.print(seconds_now() - start);
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
