#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "apps/common/command_line.h"
#include "apps/common/tool_options.h"

namespace stymo {

struct DrawnOptions {
    ModelOptions model;
    std::filesystem::path data;
    std::string ids;
    std::filesystem::path identity;  ///< weights of MobileFaceNet
    std::int64_t count = 200;        ///< number of faces to sample
    double truncation = 0.7;         ///< CodeStatistics::sample
    std::filesystem::path sheet;     ///< image file; empty: none is written
};

/// Compares faces sampled from the model with photos: the kernel distance of their embeddings, and
/// for reference that between two halves of the photos. Each sampled face is rendered with the
/// camera of a photo. The sheet shows the first 32 faces. Throws ValueError for a model without
/// code statistics.
[[nodiscard]] AppResult evaluate_drawn(const DrawnOptions& options, std::uint64_t seed);

}  // namespace stymo
