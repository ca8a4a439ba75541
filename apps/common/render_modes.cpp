#include "apps/common/render_modes.h"

#include <algorithm>
#include <array>

namespace stymo {

const std::vector<std::string>& render_mode_names() {
    static const std::vector<std::string> names{"exact", "skip", "half", "baked",
                                                "bf16"};  // bf16: the older name of half
    return names;
}

RenderMode render_mode(const std::string& name) {
    const auto place = std::ranges::find(render_mode_names(), name) - render_mode_names().begin();
    return std::array{RenderMode::exact, RenderMode::skip, RenderMode::half, RenderMode::baked,
                      RenderMode::half}[static_cast<std::size_t>(place)];
}

}  // namespace stymo
