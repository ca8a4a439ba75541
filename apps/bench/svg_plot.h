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

enum class PlotScale { logarithmic, linear };

/// Points over two axes. Series take 8 colours in turn and are dashed from the ninth on.
struct Plot {
    std::string title;
    std::string x_label;  ///< with its unit
    std::string y_label;
    std::vector<PlotSeries> series;
    PlotScale x_scale = PlotScale::logarithmic;
    PlotScale y_scale = PlotScale::logarithmic;
};

/// The plot as an SVG document on a light background, without scripts or fonts of its own. Throws
/// ValueError for a coordinate that is not finite, or not positive on a logarithmic axis, or if
/// there is no point at all.
[[nodiscard]] std::string to_svg(const Plot& plot);

}  // namespace stymo
