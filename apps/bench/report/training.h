#pragma once

#include "apps/bench/report/section.h"

namespace stymo {

/// The first stage with 16, 32 and 64 samples on a ray: loss against time, on synthetic heads made for it.
[[nodiscard]] ReportSection training_section();

}  // namespace stymo
