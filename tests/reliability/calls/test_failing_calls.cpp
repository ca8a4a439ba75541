// Calls of the system that fail one after the other.
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdlib>
#include <iostream>
#include <string>

#include "core/clock.h"
#include "reliability/calls/branches.h"
#include "reliability/calls/outcome_checks.h"

namespace {

using namespace stymo;
namespace fs = std::filesystem;

struct Call {
    const char* name;
    CallKind kind;
    int error;
};

constexpr Call calls[] = {
    {"write", CallKind::write, ENOSPC}, {"flush", CallKind::flush, EIO},
    {"open", CallKind::open, EMFILE},   {"rename", CallKind::rename, EIO},
    {"read", CallKind::read, EIO},      {"allocate", CallKind::allocate, ENOMEM}};

std::string setting(const char* name) {
    const char* const text = std::getenv(name);
    return text == nullptr ? "" : text;
}

/// The C library itself ends a process that cannot register the destructor of a variable of a
/// thread, which takes some bytes once for each such variable.
bool is_fatal_to_the_library(const ToolOutcome& outcome) {
    return outcome.err.find("failed to register TLS destructor") != std::string::npos;
}

/// Failing calls of one kind in one job.
struct Trials {
    const ShortJob& job;
    const Call& call;
    FinishedStates states;
    long failed = 0, survived = 0, fatal = 0;

    void check(const Branch& branch) {
        INFO(job.name << ": " << call.name << " " << branch.number
                      << (branch.ever ? " and all after it" : ""));
        const ToolOutcome& outcome = branch.outcome;
        INFO(outcome.err);
        ++failed;
        if (outcome.exit_code == 0) ++survived;
        if (is_fatal_to_the_library(outcome)) {
            ++fatal;
            return;
        }
        // A photo that cannot be read is left out, as a broken one is, and the tool says so.
        const bool photo = (outcome.err + outcome.out).find("photos/") != std::string::npos ||
                           outcome.err.find("faces/images/") != std::string::npos ||
                           outcome.err.find("faces/masks/") != std::string::npos;
        if (outcome.exit_code == 0 && photo) return;
        if (outcome.exit_code != 0) check_says_so(job.command, outcome);
        check_no_temporary_files(branch.out);
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
        fail_in_copies(
            job, watched, places, setting("STYMO_CALLS") == "all" ? Chosen::all : Chosen::ends,
            call.kind == CallKind::write, [&](const Branch& branch) { trials.check(branch); });
        // Some texts depend on the time, and allocate in one run only.
        CHECK(1000 * places.failed() >= 999 * places.count());
        std::cout << job.name << ", " << call.name << ": " << places.calls() << " calls from "
                  << places.count() << " places; " << trials.failed << " trials, with a failure at "
                  << places.failed() << " of the places; " << trials.survived << " did not matter; "
                  << trials.fatal << " ended in the C library; " << trials.states.count()
                  << " states of the disk; " << seconds_now() - start << " s" << std::endl;
    }
}

}  // namespace

TEST_CASE("training says which call failed and goes on with the same bits", "[slow]") {
    fail_each(training());
}

TEST_CASE("a resumed training says which call failed and goes on with the same bits", "[slow]") {
    fail_each(resumed_training());
}

TEST_CASE("a fit says which call failed and leaves nothing half-written", "[slow]") {
    fail_each(fitting());
}

TEST_CASE("a preparation says which call failed and goes on with the same files", "[slow]") {
    fail_each(preparation());
}

TEST_CASE("on two threads training says that an allocation failed", "[slow]") {
    const ShortJob job = training();
    FinishedStates states;
    long failed = 0;
    // The order of the threads' calls differs between runs, so that these are any twenty.
    for (long number = 5000; number <= 160000; number += 8000) {
        const ScratchFolder disk;
        const WatchedCalls watched{CallKind::allocate, ENOMEM, ""};
        FailingNumber visitor(number);
        const ToolOutcome outcome =
            RunningCopy(short_data(), job.command + (disk / "out").string() + " --threads 2", [&] {
                watch_calls(watched, visitor);
            }).wait();
        INFO("allocation " << number);
        if (is_fatal_to_the_library(outcome)) continue;
        check_no_temporary_files(disk / "out");
        if (outcome.exit_code != 0) {
            ++failed;
            check_says_so(job.command, outcome);
        }
        states.finish(job, disk / "out");
    }
    CHECK(failed > 10);
}

#ifdef STYMO_TEST_SANITIZED
TEST_CASE("the leak sanitizer sees what a copy of this process loses") {
    const ToolOutcome outcome = RunningCopy(short_data(), "stymo-train --print-keys", [] {
                                    void* volatile lost = std::malloc(1000);
                                    lost = nullptr;
                                    static_cast<void>(lost == nullptr);
                                }).wait();
    CHECK(outcome.exit_code == 23);
}
#endif
