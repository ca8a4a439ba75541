#pragma once

#include <functional>
#include <optional>
#include <string>

#include "nn/models/decoder.h"

namespace stymo {

/// Why the model cannot render with a camera; nothing if it can. With sampling planes that are
/// fixed in the world (DecoderConfig::depth_planes), it cannot if a ray is nearly parallel to the
/// planes, as in a photo near profile.
[[nodiscard]] std::optional<std::string> camera_problem(const DecoderConfig& config,
                                                        const Camera& camera);

/// Returns why a face with this pose must be left out (`camera_problem`), or nothing.
using CameraCheck = std::function<std::optional<std::string>(const Pose&, const Intrinsics&)>;
/// `with_mirror`: the mirror image of the face must be renderable too.
[[nodiscard]] CameraCheck camera_check(const DecoderConfig& config, bool with_mirror);

}  // namespace stymo
