#pragma once

#include <string>
#include <vector>

#include "apps/bench/report.h"
#include "apps/bench/subject.h"

namespace stymo {

/// A way of making frames, with what it takes and how far it is from the exact frame.
struct CurvePoint {
    std::string series;  ///< what is varied
    std::string value;
    double seconds = 0.0;  ///< of a frame, median
    double root_mean_square = 0.0;
    double psnr_worst = 0.0;
};

/// Error against frame time over samples, tolerance, precision, baked resolution.
[[nodiscard]] std::vector<CurvePoint> measure_curve(const BenchSubject& subject, const BenchOptions& options);
[[nodiscard]] Cells curve_cells(const std::vector<CurvePoint>& points);
[[nodiscard]] JsonValue to_json(const std::vector<CurvePoint>& points);
/// SVG. Frames without any error have no place on it; empty if none has one.
[[nodiscard]] std::string curve_plot(const std::vector<CurvePoint>& points);

}  // namespace stymo
