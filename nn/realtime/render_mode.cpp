#include "nn/realtime/render_mode.h"

#include <algorithm>
#include <array>

namespace stymo {

std::span<const RenderModeTraits> render_modes() {
    static constexpr std::array modes{
        RenderModeTraits{.mode = RenderMode::exact, .name = "exact", .help = "every sample"},
        RenderModeTraits{.mode = RenderMode::skip,
                         .name = "skip",
                         .help = "significant samples only, and render blocks in bfloat16 unless "
                                 "--matmul-precision highest is given",
                         .tolerates = true},
    };
    return modes;
}

const RenderModeTraits& traits_of(RenderMode mode) {
    return *std::ranges::find(render_modes(), mode, &RenderModeTraits::mode);
}

MatmulPrecision products_of(RenderMode mode) {
    const MatmulPrecision own = matmul_precision();
    return tolerates(mode) && own != MatmulPrecision::highest ? MatmulPrecision::medium : own;
}

}  // namespace stymo
