#pragma once

#include <optional>
#include <string>

#include "apps/common/tool_options.h"
#include "fit/fit_job.h"

namespace stymo {

/// The job of stymo-fit, with everything that must outlive it.
struct Fitting {
    /// Loads the model and the networks. Throws what they throw.
    Fitting(const ModelOptions& model, const LpipsOptions& lpips, FitJobOptions options);
    Fitting(const Fitting&) = delete;
    Fitting& operator=(const Fitting&) = delete;

    /// What is strange about the score of the final image; empty if nothing is.
    [[nodiscard]] std::string doubt_of(const FitReport& report) const;

    std::string mark;  ///< model_mark
    Model model;
    ReconstructionConfig config;
    ReconstructionLoss loss;
    std::optional<Lpips> own_lpips;
    const Lpips* lpips;  ///< measures LPIPS; null: it is not measured
    FitJob job;
};

}  // namespace stymo
