#pragma once

#include <string>
#include <vector>

#include "nn/models/realtime/face_renderer.h"

namespace stymo {

/// Names of --mode.
[[nodiscard]] const std::vector<std::string>& render_mode_names();
/// One of these names.
[[nodiscard]] RenderMode render_mode(const std::string& name);
/// The inverse.
[[nodiscard]] const std::string& render_mode_name(RenderMode mode);

}  // namespace stymo
