#pragma once

#include <string>
#include <vector>

namespace stymo {

struct PlotPoint {
    double x = 0.0;
    double y = 0.0;
    std::string label{};  ///< text next to the point
};

struct PlotSeries {
    std::string name;
    std::vector<PlotPoint> points;  ///< connected in this order
};

enum class PlotScale { logarithmic, linear };

/// A plot with two axes. Series use 8 colours in turn; from the ninth on they are dashed.
struct Plot {
    std::string title;
    std::string x_label;  ///< with its unit
    std::string y_label;
    std::vector<PlotSeries> series;
    PlotScale x_scale = PlotScale::logarithmic;
    PlotScale y_scale = PlotScale::logarithmic;
};

/// The plot as an SVG document on a light background, without scripts or embedded fonts. Throws
/// ValueError for a coordinate that is not finite, or not positive on a logarithmic axis, and if
/// there are no points.
[[nodiscard]] std::string to_svg(const Plot& plot);

}  // namespace stymo
