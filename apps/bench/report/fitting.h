#pragma once

#include <vector>

#include "apps/bench/report/section.h"

namespace stymo {

/// What a fit had reached after some seconds.
struct FitPoint {
    std::int64_t steps = 0;
    double seconds = 0.0;
    double loss = 0.0;
    double psnr = 0.0;
};

/// The first of the points, in order of time, whose loss is at most `loss`; null if there is none.
[[nodiscard]] const FitPoint* first_reaching(const std::vector<FitPoint>& points, double loss);
/// The last point not later than `seconds`, the first one if all are.
[[nodiscard]] const FitPoint& point_at(const std::vector<FitPoint>& points, double seconds);

/// Ways of fitting: loss and PSNR against seconds, and which is first at the loss that the paper's has at its end.
[[nodiscard]] ReportSection fitting_section();

}  // namespace stymo
