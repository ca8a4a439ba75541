#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "apps/bench/report/quadrature_rules.h"
#include "apps/bench/report/section.h"

namespace stymo {

/// Root mean squares over rays.
struct QuadratureError {
    double colour = 0.0;
    double transmittance = 0.0;
    double colour_by_log_density = 0.0;
};
[[nodiscard]] QuadratureError quadrature_error(const RayResults& results, std::span<const RayProfile> rays);

/// Minus the slope of log error over log count, by least squares over the counts from 64 on. Errors at or below `floor` are
/// round-off, those above 1 no approximation: neither counts. Empty where fewer than three are left.
[[nodiscard]] std::optional<double> observed_order(std::span<const std::int64_t> counts, std::span<const double> errors,
                                                   double floor);

/// Rules of quadrature on rays with closed forms: errors against evaluations and time, orders of convergence, Euler's escape.
[[nodiscard]] ReportSection quadrature_section();

}  // namespace stymo
