#pragma once

#include <optional>
#include <string>

#include "apps/common/command_line.h"
#include "nn/models/model.h"

namespace stymo {

/// What a command line says about LPIPS; what it leaves out is the model's own.
struct LpipsOptions {
    std::string metric;                       ///< network of the metric, "squeeze", "vgg16" or "alex"; empty: none was asked for
    std::optional<double> perceptual_weight;  ///< of the term while fitting
    std::optional<std::int64_t> perceptual_resolution;  ///< of the same
    std::string trunk;
    std::string heads;
};

/// --lpips
void declare_lpips_metric(Command& command, LpipsOptions& options);
/// --lpips-trunk and --lpips-heads
void declare_lpips_files(Command& command, LpipsOptions& options);
/// --perceptual-weight and --perceptual-resolution
void declare_perceptual_weight(Command& command, LpipsOptions& options);

/// The metric's network with its files: those of the command line, or the model's if they belong to the same network.
[[nodiscard]] LpipsConfig metric_config(const LpipsOptions& options, const LpipsConfig& model);
/// The model's reconstruction loss with weight and resolution of the command line, and with its files unless they belong to the
/// metric alone.
[[nodiscard]] ReconstructionConfig fitting_config(const LpipsOptions& options, ReconstructionConfig model);

}  // namespace stymo
