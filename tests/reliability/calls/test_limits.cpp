// Disks that are full or read-only, and limits of the system.
#include <sys/mount.h>
#include <sys/resource.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cerrno>
#include <fstream>
#include <iostream>
#include <optional>
#include <string>

#include "reliability/calls/failing_calls.h"
#include "reliability/calls/outcome_checks.h"

namespace {

using namespace stymo;
namespace fs = std::filesystem;

constexpr rlim_t mebibyte = rlim_t{1} << 20U;

rlim_t address_space() {
    std::ifstream file("/proc/self/statm");
    rlim_t pages = 0;
    file >> pages;
    return pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

void limit(__rlimit_resource resource, rlim_t most) {
    const rlimit value{most, most};
    if (::setrlimit(resource, &value) != 0) ::_exit(125);
}

/// Runs a job in a copy of this process that `prepare` has limited, and again without limit.
void check_limited(const ShortJob& job, const std::string& name,
                   const std::function<void()>& prepare) {
    const ScratchFolder disk;
    const fs::path out = disk / "out";
    const ToolOutcome outcome =
        RunningCopy(short_data(), job.command + out.string(), prepare).wait();
    INFO(job.name << ": " << name);
    INFO(outcome.err);
    if (outcome.exit_code != 0) check_says_so(job.command, outcome);
    check_no_temporary_files(out);
    FinishedStates().finish(job, out);
}

/// A file system in memory at a folder. Only the administrator can mount one.
class SmallDisk {
public:
    SmallDisk() : mounted_(mount(0, "1m")) {
        if (!mounted_) std::cout << "skipped: no file system can be mounted\n";
    }
    ~SmallDisk() {
        if (mounted_) ::umount2(folder_.path().c_str(), MNT_DETACH);
    }
    SmallDisk(const SmallDisk&) = delete;
    SmallDisk& operator=(const SmallDisk&) = delete;

    [[nodiscard]] bool is_mounted() const { return mounted_; }
    [[nodiscard]] fs::path out() const { return folder_ / "out"; }
    void resize(const std::string& size) const { REQUIRE(mount(MS_REMOUNT, size)); }
    void make_read_only() const { REQUIRE(mount(MS_REMOUNT | MS_RDONLY, "1m")); }

private:
    [[nodiscard]] bool mount(unsigned long flags, const std::string& size) const {
        return ::mount("tmpfs", folder_.path().c_str(), "tmpfs", flags, ("size=" + size).c_str()) ==
               0;
    }

    ScratchFolder folder_;
    bool mounted_;
};

void check_refuses_read_only(const ShortJob& job, const fs::path& out,
                             const std::function<void()>& prepare = {}) {
    INFO(job.command << out);
    const ToolOutcome outcome =
        RunningCopy(short_data(), job.command + out.string(), prepare).wait();
    INFO(outcome.err);
    check_says_so(job.command, outcome);
    CHECK_THAT(outcome.err, Catch::Contains("Read-only file system"));
    CHECK_THAT(outcome.err, !Catch::Contains("%"));  // before the work
    CHECK((!fs::exists(out) || fs::is_empty(out)));
}

}  // namespace

TEST_CASE("a full disk is an error of one line, and the tool goes on when there is room",
          "[slow]") {
    for (const ShortJob& job : {training(), fitting(), preparation()}) {
        for (const char* size : {"4k", "16k", "64k", "1m", "6m", "12m", "20m"}) {
            const SmallDisk disk;
            if (!disk.is_mounted()) return;
            disk.resize(size);
            const ToolOutcome outcome =
                RunningCopy(short_data(), job.command + disk.out().string()).wait();
            INFO(job.name << ": disk of " << size);
            INFO(outcome.err);
            if (outcome.exit_code != 0) {
                check_says_so(job.command, outcome);
                CHECK_THAT(outcome.err, Catch::Contains("No space left on device") ||
                                            Catch::Contains("check space and rights"));
            }
            check_no_temporary_files(disk.out());
            disk.resize("200m");
            FinishedStates().finish(job, disk.out());
        }
    }
}

TEST_CASE("a file system that is read-only is an error of one line", "[slow]") {
    // Permissions would not keep a test that runs as root from writing.
    for (const ShortJob& job : {training(), fitting(), preparation()}) {
        const ScratchFolder disk;
        const WatchedCalls calls{CallKind::create, EROFS, fs::canonical(disk.path())};
        FailingNumber all(1, true);
        fs::create_directory(disk / "out");
        for (const fs::path& out : {disk / "out", disk / "new"})
            check_refuses_read_only(job, out, [&] { watch_calls(calls, all); });
        const SmallDisk mounted;
        if (!mounted.is_mounted()) continue;
        fs::create_directory(mounted.out());
        mounted.make_read_only();
        for (const fs::path& out : {mounted.out(), mounted.out() / "new"})
            check_refuses_read_only(job, out);
    }
}

TEST_CASE("files that may not grow and too few open files are errors of one line", "[slow]") {
    for (const ShortJob& job : {training(), fitting(), preparation()}) {
        // The tool's own messages go to a file too, so the least limit leaves room for them.
        for (const rlim_t bytes : {rlim_t{4000}, rlim_t{10000}, mebibyte})
            check_limited(job, "files of " + std::to_string(bytes) + " bytes",
                          [&] { limit(RLIMIT_FSIZE, bytes); });
        for (const rlim_t files : {4, 5, 6, 8})
            check_limited(job, std::to_string(files) + " open files",
                          [&] { limit(RLIMIT_NOFILE, files); });
    }
}

#ifndef STYMO_TEST_SANITIZED  // the sanitizer's own memory has no limit
TEST_CASE("too little memory is an error of one line", "[slow]") {
    for (const ShortJob& job : {training(), fitting(), preparation()})
        for (const rlim_t more : {0, 1, 4, 16, 64, 80, 100, 130, 200})
            check_limited(job, std::to_string(more) + " MiB more",
                          [&] { limit(RLIMIT_AS, address_space() + more * mebibyte); });
}
#endif
