#pragma once

#include <optional>
#include <string>

#include "apps/common/command_line.h"
#include "nn/models/model.h"

namespace stymo {

/// The options on LPIPS. Options that are not given keep the model's settings.
struct LpipsOptions {
    std::string metric;  ///< network of the metric, "squeeze", "vgg16" or "alex"; empty: no metric
    std::string
        perceptual_network{};  ///< of the term while fitting, or "encoder"; empty: the model's
    std::optional<double> perceptual_weight;            ///< of the term while fitting
    std::optional<std::int64_t> perceptual_resolution;  ///< of the same
    std::string trunk;
    std::string heads;
};

/// --lpips
void declare_lpips_metric(Command& command, LpipsOptions& options);
/// --lpips-trunk and --lpips-heads
void declare_lpips_files(Command& command, LpipsOptions& options);
/// --perceptual-network, --perceptual-weight and --perceptual-resolution
void declare_perceptual_weight(Command& command, LpipsOptions& options);

/// The network of the metric with its files: those of the command line, or those of the model if it
/// uses the same network.
[[nodiscard]] LpipsConfig metric_config(const LpipsOptions& options, const LpipsConfig& model);
/// The model's reconstruction loss with the weight and resolution of the command line, and with its
/// files if they belong to the same network.
[[nodiscard]] ReconstructionConfig fitting_config(const LpipsOptions& options,
                                                  ReconstructionConfig model);

}  // namespace stymo
