#pragma once

#include <string>
#include <vector>

#include "nn/realtime/face_renderer.h"

namespace stymo {

/// The values of --mode.
[[nodiscard]] const std::vector<std::string>& render_mode_names();
/// The mode with one of these names.
[[nodiscard]] RenderMode render_mode(const std::string& name);
/// The name of a mode.
[[nodiscard]] const std::string& render_mode_name(RenderMode mode);

}  // namespace stymo
