#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "apps/common/command_line.h"
#include "apps/common/model_options.h"

namespace stymo {

struct DrawnOptions {
    ModelOptions model;
    std::filesystem::path data;
    std::string ids;
    std::filesystem::path identity;  ///< weights of MobileFaceNet
    std::int64_t count = 200;        ///< faces to draw
    double truncation = 0.7;         ///< CodeStatistics::sample
    std::filesystem::path sheet;     ///< empty: none is written
};

/// How far faces drawn from the model are from photos: the kernel distance of their embeddings,
/// beside that of two halves of the photos. Each drawn face is seen by the camera of a photo. The
/// sheet shows the first 32. Throws ValueError for a model without statistics of codes.
[[nodiscard]] AppResult evaluate_drawn(const DrawnOptions& options, std::uint64_t seed);

}  // namespace stymo
