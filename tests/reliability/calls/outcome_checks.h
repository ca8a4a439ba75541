#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "reliability/calls/short_jobs.h"

namespace stymo {

/// Checks that a tool ended with exit code 1 and one line, behind the lines of progress, that
/// begins with its name.
void check_says_so(const std::string& command, const ToolOutcome& outcome);

/// Checks that no file that was being written is left.
void check_no_temporary_files(const std::filesystem::path& folder);

/// The states of output folders from which a job has been finished, so that none is tried twice.
class FinishedStates {
public:
    /// Finishes the job from what is in its output folder, and compares.
    void finish(const ShortJob& job, const std::filesystem::path& out);
    [[nodiscard]] std::size_t count() const { return seen_.size(); }

private:
    std::set<std::string> seen_;
};

}  // namespace stymo
