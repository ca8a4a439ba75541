#pragma once

#include <span>
#include <string>
#include <string_view>

#include "core/matmul_precision.h"

namespace stymo {

/// How a face is rendered. All modes but `exact` save work; docs/numerics.md has their errors.
enum class RenderMode {
    exact,  ///< every sample, float32
    skip,   ///< without samples that are insignificant at the tolerance and without pixels that
            ///< show only the background; render blocks as `products_of` says
};

/// What a mode is called and what it does.
struct RenderModeTraits {
    RenderMode mode;
    std::string_view name;
    std::string_view help;   ///< what it does, in a few words
    bool tolerates = false;  ///< reads RendererOptions::tolerance
};

/// All modes. A new one needs its value above and its row here.
[[nodiscard]] std::span<const RenderModeTraits> render_modes();
[[nodiscard]] const RenderModeTraits& traits_of(RenderMode mode);

[[nodiscard]] inline bool tolerates(RenderMode mode) {
    return traits_of(mode).tolerates;
}
/// The precision of products in a mode's render blocks: `medium` if it tolerates, unless this
/// process computes in `highest`; else that of this process. The field keeps this process's, since
/// a small error of an opacity moves the outline.
[[nodiscard]] MatmulPrecision products_of(RenderMode mode);
[[nodiscard]] inline std::string name_of(RenderMode mode) {
    return std::string(traits_of(mode).name);
}

}  // namespace stymo
