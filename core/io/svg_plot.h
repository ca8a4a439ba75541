#pragma once

#include <string>
#include <vector>

namespace stymo {

struct PlotPoint {
    double x = 0.0;
    double y = 0.0;
    std::string label{};  ///< stands beside the point
};

struct PlotSeries {
    std::string name;
    std::vector<PlotPoint> points;  ///< joined in this order
};

/// Points over two logarithmic axes.
struct Plot {
    std::string title;
    std::string x_label;  ///< with its unit
    std::string y_label;
    std::vector<PlotSeries> series;
};

/// The plot as an SVG document on a light background, without scripts or fonts of its own. Throws ValueError for a coordinate
/// that is not positive and finite, or if there is no point at all.
[[nodiscard]] std::string to_svg(const Plot& plot);

}  // namespace stymo
