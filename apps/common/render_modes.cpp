#include "apps/common/render_modes.h"

#include <algorithm>
#include <array>

namespace stymo {

namespace {

/// In the order of their names.
constexpr std::array modes{RenderMode::exact, RenderMode::skip, RenderMode::half, RenderMode::baked,
                           RenderMode::half};

}  // namespace

const std::vector<std::string>& render_mode_names() {
    static const std::vector<std::string> names{"exact", "skip", "half", "baked",
                                                "bf16"};  // bf16: the older name of half
    return names;
}

RenderMode render_mode(const std::string& name) {
    const auto place = std::ranges::find(render_mode_names(), name) - render_mode_names().begin();
    return modes[static_cast<std::size_t>(place)];
}

const std::string& render_mode_name(RenderMode mode) {
    const auto place = std::ranges::find(modes, mode) - modes.begin();
    return render_mode_names()[static_cast<std::size_t>(place)];
}

}  // namespace stymo
