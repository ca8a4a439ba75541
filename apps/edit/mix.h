#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/command_line.h"

namespace stymo {

struct MixOptions {
    std::filesystem::path model;
    std::vector<std::string> sources;
    std::vector<std::string> targets;
    std::string take;
    std::int64_t sampled = 0;  ///< sources drawn from the training codes
    double truncation = 0.7;
    std::optional<std::int64_t> samples;
    std::filesystem::path out;
};

/// `stymo-edit mix`; `options` outlives the line.
void declare_mix(CommandLine& line, MixOptions& options);

}  // namespace stymo
