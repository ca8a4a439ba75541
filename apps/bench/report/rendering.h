#pragma once

#include "apps/bench/report/section.h"

namespace stymo {

/// Frames with less work against the exact frame: error against frame time.
[[nodiscard]] ReportSection rendering_section();

}  // namespace stymo
