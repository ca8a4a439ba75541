#pragma once

#include <cstdint>
#include <vector>

namespace stymo {

/// The state of a fit after some steps.
struct FitPoint {
    std::int64_t steps = 0;
    double seconds = 0.0;
    double loss = 0.0;
    double psnr = 0.0;
};

/// The first point whose loss is at most `loss`; null if there is none.
[[nodiscard]] const FitPoint* first_reaching(const std::vector<FitPoint>& points, double loss);
/// The last point at or before `seconds`; the first point if all are later.
[[nodiscard]] const FitPoint& point_at(const std::vector<FitPoint>& points, double seconds);

}  // namespace stymo
