#pragma once

#include <filesystem>
#include <optional>

#include "apps/common/command_line.h"

namespace stymo {

struct DisentangleOptions {
    std::filesystem::path model;
    std::optional<std::filesystem::path> morphable;
    std::int64_t pairs = 64;
};

/// `stymo-edit disentangle`; `options` outlives the line.
void declare_disentangle(CommandLine& line, DisentangleOptions& options);

}  // namespace stymo
