#pragma once

#include <functional>
#include <optional>
#include <string>

#include "nn/models/decoder.h"

namespace stymo {

/// Why the model cannot render what a camera sees, or nothing. With sampling planes that are fixed
/// in the world (DecoderConfig::depth_planes) this is a camera from which a ray runs nearly along
/// the planes: a photo near profile.
[[nodiscard]] std::optional<std::string> camera_problem(const DecoderConfig& config,
                                                        const Camera& camera);

/// Decides which faces of a folder are left out: `camera_problem` of a face's pose.
using CameraCheck = std::function<std::optional<std::string>(const Pose&, const Intrinsics&)>;
/// `with_mirror`: the face as a mirror shows it must be rendered too.
[[nodiscard]] CameraCheck camera_check(const DecoderConfig& config, bool with_mirror);

}  // namespace stymo
