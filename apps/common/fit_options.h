#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "apps/common/command_line.h"
#include "fit/fit_job.h"

namespace stymo {

/// The options of fits and tuning, which are the same in all tools.
struct FitToolOptions {
    FitJobOptions job{};
    std::string optimizer = "adam";
    std::optional<std::int64_t> samples{};  ///< empty: the model's setting

    /// The options of the job with optimiser and samples.
    [[nodiscard]] FitJobOptions job_options() const;
};

/// Declares --steps, --optimizer and all other options of fits and tuning.
void declare_fit(Command& command, FitToolOptions& options);

}  // namespace stymo
