#pragma once

#include "apps/bench/report/section.h"

namespace stymo {

/// Stiff and extreme cases, float32 against float64 of the same code: the rows of stability_case.h.
[[nodiscard]] ReportSection stability_section();

}  // namespace stymo
