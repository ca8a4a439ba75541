#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

namespace stymo {

/// Calls of the C library that can be made to fail. `create` is what a read-only file system
/// refuses.
enum class CallKind { none, open, read, write, flush, rename, create, allocate };

/// What happens to the calls of this process from `watch_calls` on. Calls on files count if their
/// absolute path, without symbolic links, begins with `place`.
struct CallPlan {
    CallKind kind = CallKind::none;
    long fails_at = 0;      ///< number of the call that fails, from 1 on; 0: none
    bool ever = false;      ///< the later calls fail, too
    int error = 0;          ///< errno of those that fail
    bool lists = false;     ///< collect the places that call
    std::string place = {};
};

/// A place in the program that makes such calls: the innermost return addresses on the stack.
struct CallPlace {
    static constexpr std::size_t depth = 8;
    std::uint64_t hash = 0;  ///< 0: none
    long first = 0;          ///< number of the first call from here
    long last = 0;
    std::array<void*, depth> frames{};
};

/// What a process did. It lies in memory that a process shares with its copies.
struct CallReport {
    std::atomic<long> calls = 0;
    std::atomic<long> failed = 0;             ///< calls that failed
    std::atomic<std::uint64_t> failed_at = 0;  ///< `CallPlace::hash` of the first of them
    std::atomic<std::size_t> place_count = 0;
    std::array<CallPlace, std::size_t{1} << 17U> places{};  ///< a hash table
};

/// Begins to count calls; `plan` and `report` must outlive the process or the next call.
void watch_calls(const CallPlan& plan, CallReport& report);
void stop_watching_calls();

/// A `CallReport` that copies of this process (fork) write to.
class SharedReport {
public:
    SharedReport();
    ~SharedReport();
    SharedReport(const SharedReport&) = delete;
    SharedReport& operator=(const SharedReport&) = delete;
    [[nodiscard]] CallReport& operator*() const { return *report_; }
    [[nodiscard]] CallReport* operator->() const { return report_; }

private:
    CallReport* report_;
};

}  // namespace stymo
