#pragma once

#include <optional>
#include <string>

#include "apps/common/command_line.h"
#include "nn/models/model.h"

namespace stymo {

/// The options for LPIPS. Options that are not given keep the model's settings.
struct LpipsOptions {
    std::string metric;  ///< network of the metric, "squeeze", "vgg16" or "alex"; empty: no metric
    /// Network of the perceptual term of fitting, or "encoder"; empty: the model's.
    std::string perceptual_network{};
    std::optional<double> perceptual_weight;            ///< weight of the perceptual term
    std::optional<std::int64_t> perceptual_resolution;  ///< resolution of the perceptual term
    std::string trunk;
    std::string heads;
};

/// Declares --lpips.
void declare_lpips_metric(Command& command, LpipsOptions& options);
/// Declares --lpips-trunk and --lpips-heads.
void declare_lpips_files(Command& command, LpipsOptions& options);
/// Declares --perceptual-network, --perceptual-weight and --perceptual-resolution.
void declare_perceptual_weight(Command& command, LpipsOptions& options);

/// The network of the metric with its files: from the command line, or from the model if it uses
/// the same network.
[[nodiscard]] LpipsConfig metric_config(const LpipsOptions& options, const LpipsConfig& model);
/// The model's reconstruction loss with the perceptual network, weight and resolution of the
/// command line, and with the files of the command line if they belong to the same network.
[[nodiscard]] ReconstructionConfig fitting_config(const LpipsOptions& options,
                                                  ReconstructionConfig model);

}  // namespace stymo
