#pragma once

#include <cstdint>
#include <vector>

namespace stymo {

/// Where a fit is after so many steps and seconds.
struct FitPoint {
    std::int64_t steps = 0;
    double seconds = 0.0;
    double loss = 0.0;
    double psnr = 0.0;
};

/// The first point whose loss is at most `loss`; null if there is none.
[[nodiscard]] const FitPoint* first_reaching(const std::vector<FitPoint>& points, double loss);
/// The last point that is not later; the first one if all are.
[[nodiscard]] const FitPoint& point_at(const std::vector<FitPoint>& points, double seconds);

}  // namespace stymo
