#pragma once

#include <functional>
#include <optional>
#include <string>

#include "nn/models/decoder.h"

namespace stymo {

/// Returns why a face with this pose must be left out (`camera_problem`), or nothing.
using CameraCheck = std::function<std::optional<std::string>(const Pose&, const Intrinsics&)>;
/// `with_mirror`: the mirror image of the face must be renderable too.
[[nodiscard]] CameraCheck camera_check(const DecoderConfig& config, bool with_mirror);

}  // namespace stymo
