#pragma once

#include <string>
#include <vector>

#include "apps/bench/frames.h"
#include "apps/bench/report.h"
#include "apps/bench/subject.h"
#include "core/io/svg_plot.h"

namespace stymo {

/// A way of making frames, with what it takes and how far it is from the exact frame.
struct CurvePoint {
    std::string series;  ///< what is varied
    std::string value;
    double seconds = 0.0;  ///< of a frame, median
    PictureError error;
};

/// Error against frame time over samples, tolerance, precision, baked resolution; the exact frame comes first.
[[nodiscard]] std::vector<CurvePoint> measure_curve(const BenchSubject& subject, const BenchOptions& options);
[[nodiscard]] Cells curve_cells(const std::vector<CurvePoint>& points);
[[nodiscard]] JsonValue to_json(const std::vector<CurvePoint>& points);
/// A number of each point against its time. Points whose number is not finite, or not positive on a logarithmic scale, have no
/// place on it; without any other the plot has no series.
[[nodiscard]] Plot curve_plot(const std::vector<CurvePoint>& points, const std::string& title, const std::string& label,
                              PlotScale scale, double PictureError::*number);
/// The root mean square error.
[[nodiscard]] Plot error_plot(const std::vector<CurvePoint>& points);

}  // namespace stymo
