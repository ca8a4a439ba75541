#pragma once

#include <optional>
#include <string>

#include "nn/models/decoder.h"

namespace stymo {

/// Why the model cannot render with a camera; nothing if it can. With sampling planes that are
/// fixed in the world (DecoderConfig::depth_planes), it cannot if a ray is nearly parallel to the
/// planes, as in a photo near profile.
[[nodiscard]] std::optional<std::string> camera_problem(const DecoderConfig& config,
                                                        const Camera& camera);

}  // namespace stymo
