#pragma once

#include <array>
#include <climits>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "reliability/calls/failing_calls.h"
#include "reliability/calls/short_jobs.h"

namespace stymo {

/// A place in the program that makes calls of one kind.
struct CallPlace {
    std::uint64_t stack = 0;  ///< 0: none
    long calls = 0;           ///< from here
    long seen = 0;            ///< of them, so far
    long failed = 0;          ///< of them
};

/// Places of one run of a tool, in memory that processes share.
class CallPlaces {
public:
    CallPlaces();
    ~CallPlaces();
    CallPlaces(const CallPlaces&) = delete;
    CallPlaces& operator=(const CallPlaces&) = delete;

    /// The place of a stack; a new one if there is none. Does not allocate.
    [[nodiscard]] CallPlace& at(std::uint64_t stack);
    [[nodiscard]] long count() const { return table_->count; }
    [[nodiscard]] long calls() const;
    [[nodiscard]] long failed() const;  ///< places where a call failed

private:
    struct Table {
        long count;
        std::array<CallPlace, std::size_t{1} << 17U> places;
    };
    Table* table_;
};

/// Runs a job once to its end and counts the calls from each place.
void count_calls(const ShortJob& job, const WatchedCalls& calls, CallPlaces& places);

enum class Chosen {
    ends,  ///< the first and the last call from each place
    all,
};

/// A copy of a tool in which a call has failed, after its end.
struct Branch {
    long number = 0;            ///< of the call
    bool ever = false;          ///< all later calls failed, too
    ToolOutcome outcome;        ///< stderr from the failure on
    std::filesystem::path out;  ///< its output folder
};

/// Runs a job once to its end. Before each chosen call it forks: in the copy, which has an output
/// folder of its own with the same contents, the call fails (with `ever`: in a second copy all
/// later ones, too). `visit` is called after the end of each copy. Needs the counts of `places`.
void fail_in_copies(const ShortJob& job, const WatchedCalls& calls, CallPlaces& places,
                    Chosen chosen, bool ever, const std::function<void(const Branch&)>& visit);

}  // namespace stymo
