#include "apps/bench/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <sstream>

#include "core/error.h"

namespace stymo {
namespace {

constexpr double width = 820.0, height = 520.0;
constexpr double left = 80.0, right = 200.0, top = 48.0, bottom = 62.0;
/// Okabe and Ito's, which most colour-blind readers can tell apart. Series beyond them are dashed.
constexpr std::array<const char*, 8> colours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                             "#e69f00", "#56b4e9", "#000000", "#888888"};

std::string escaped(const std::string& text) {
    std::string result;
    for (const char c : text)
        result += c == '&'   ? "&amp;"
                  : c == '<' ? "&lt;"
                  : c == '>' ? "&gt;"
                  : c == '"' ? "&quot;"
                             : std::string(1, c);
    return result;
}

/// An axis from pixel `from` (at the low end) to pixel `to`.
class Axis {
public:
    Axis(PlotScale scale, const std::vector<double>& values, double from, double to)
        : logarithmic_(scale == PlotScale::logarithmic), from_(from), to_(to) {
        const auto [low, high] = std::ranges::minmax(values);
        // Room around the outermost points, and an extent even where all values are one.
        constexpr double margin = 0.08;
        const double least = logarithmic_ ? 0.5 : std::max(1e-3 * std::abs(high), 1e-300);
        const double extent = std::max(on_scale(high) - on_scale(low), least);
        low_ = on_scale(low) - margin * extent;
        high_ = on_scale(low) + (1.0 + margin) * extent;
    }
    [[nodiscard]] double place(double value) const {
        return from_ + (to_ - from_) * (on_scale(value) - low_) / (high_ - low_);
    }
    [[nodiscard]] std::vector<double> ticks() const {
        return logarithmic_ ? logarithmic_ticks() : linear_ticks();
    }

private:
    [[nodiscard]] double on_scale(double value) const {
        return logarithmic_ ? std::log10(value) : value;
    }

    /// 1, 2 and 5 times the powers of ten that lie on the axis; the powers alone where there would
    /// be many.
    [[nodiscard]] std::vector<double> logarithmic_ticks() const {
        constexpr double crowded = 2.5;
        std::vector<double> values;
        for (auto decade = std::llround(std::floor(low_)); static_cast<double>(decade) <= high_;
             ++decade) {
            for (const double digit : {1.0, 2.0, 5.0}) {
                const double value = digit * std::pow(10.0, static_cast<double>(decade));
                const bool shown = digit == 1.0 || high_ - low_ < crowded;
                if (shown && std::log10(value) >= low_ && std::log10(value) <= high_)
                    values.push_back(value);
            }
        }
        return values;
    }

    /// Multiples of 1, 2 or 5 times a power of ten, at most ten of them.
    [[nodiscard]] std::vector<double> linear_ticks() const {
        constexpr double most = 10.0;
        const double decade = std::pow(10.0, std::floor(std::log10((high_ - low_) / most)));
        double step = 10.0 * decade;
        for (const double digit : {5.0, 2.0, 1.0})
            if (digit * decade * most >= high_ - low_) step = digit * decade;
        std::vector<double> values;
        constexpr double no_sign = 0.0;  // added to -0
        for (double count = std::ceil(low_ / step); count * step <= high_; ++count)
            values.push_back(count * step + no_sign);
        return values;
    }

    bool logarithmic_;
    double from_;
    double to_;
    double low_ = 0.0;
    double high_ = 1.0;
};

bool has_place(double value, PlotScale scale) {
    return std::isfinite(value) && (scale == PlotScale::linear || value > 0.0);
}

struct TextStyle {
    const char* anchor = "start";
    int size = 12;
    const char* colour = "#222222";
    const char* attributes = "";
};

void write_text(std::ostream& svg, double x, double y, const std::string& text,
                const TextStyle& style) {
    svg << "<text x=\"" << x << "\" y=\"" << y << "\" text-anchor=\"" << style.anchor
        << "\" font-size=\"" << style.size << "\" fill=\"" << style.colour << "\""
        << style.attributes << ">" << escaped(text) << "</text>\n";
}

void write_line(std::ostream& svg, double x0, double y0, double x1, double y1, const char* colour) {
    svg << "<line x1=\"" << x0 << "\" y1=\"" << y0 << "\" x2=\"" << x1 << "\" y2=\"" << y1
        << "\" stroke=\"" << colour << "\"/>\n";
}

std::string short_number(double value) {
    std::ostringstream text;
    text << value;
    return text.str();
}

void write_axes(std::ostream& svg, const Plot& plot, const Axis& x, const Axis& y) {
    constexpr const char* grid = "#dddddd";
    for (const double tick : x.ticks()) {
        write_line(svg, x.place(tick), top, x.place(tick), height - bottom, grid);
        write_text(svg, x.place(tick), height - bottom + 18.0, short_number(tick),
                   {.anchor = "middle"});
    }
    for (const double tick : y.ticks()) {
        write_line(svg, left, y.place(tick), width - right, y.place(tick), grid);
        write_text(svg, left - 8.0, y.place(tick) + 4.0, short_number(tick), {.anchor = "end"});
    }
    svg << "<rect x=\"" << left << "\" y=\"" << top << "\" width=\"" << width - left - right
        << "\" height=\"" << height - top - bottom << "\" fill=\"none\" stroke=\"#888888\"/>\n";
    write_text(svg, left, 28.0, plot.title, {.size = 16});
    write_text(svg, (left + width - right) / 2.0, height - 16.0, plot.x_label,
               {.anchor = "middle", .size = 13});
    std::ostringstream turned;
    const double middle = (top + height - bottom) / 2.0;
    turned << " transform=\"rotate(-90 20 " << middle << ")\"";
    write_text(svg, 20.0, middle, plot.y_label,
               {.anchor = "middle", .size = 13, .attributes = turned.str().c_str()});
}

void write_series(std::ostream& svg, const PlotSeries& series, std::size_t index, const Axis& x,
                  const Axis& y) {
    const char* colour = colours.at(index % colours.size());
    const auto write_polyline = [&](const std::string& points) {
        const char* dashes = index < colours.size() ? "" : " stroke-dasharray=\"6 4\"";
        svg << "<polyline fill=\"none\" stroke-width=\"1.5\" stroke=\"" << colour << "\"" << dashes
            << " points=\"" << points << "\"/>\n";
    };
    std::ostringstream places;
    places << std::fixed << std::setprecision(1);
    for (const PlotPoint& point : series.points)
        places << x.place(point.x) << "," << y.place(point.y) << " ";
    write_polyline(places.str());
    for (const PlotPoint& point : series.points) {
        svg << "<circle cx=\"" << x.place(point.x) << "\" cy=\"" << y.place(point.y)
            << "\" r=\"4\" fill=\"" << colour << "\"/>\n";
        if (!point.label.empty())
            write_text(svg, x.place(point.x) + 6.0, y.place(point.y) - 6.0, point.label,
                       {.size = 11, .colour = colour});
    }
    const double row = top + 14.0 + 22.0 * static_cast<double>(index);
    std::ostringstream line;
    line << width - right + 6.0 << "," << row << " " << width - right + 30.0 << "," << row;
    write_polyline(line.str());
    svg << "<circle cx=\"" << width - right + 18.0 << "\" cy=\"" << row << "\" r=\"4\" fill=\""
        << colour << "\"/>\n";
    write_text(svg, width - right + 36.0, row + 4.0, series.name, {});
}

}  // namespace

std::string to_svg(const Plot& plot) {
    std::vector<double> xs, ys;
    for (const PlotSeries& series : plot.series) {
        for (const PlotPoint& point : series.points) {
            if (!has_place(point.x, plot.x_scale) || !has_place(point.y, plot.y_scale))
                fail<ValueError>("plot \"", plot.title, "\": the point (", point.x, ", ", point.y,
                                 ") of ", series.name, " has no place on its axes");
            xs.push_back(point.x);
            ys.push_back(point.y);
        }
    }
    if (xs.empty()) fail<ValueError>("plot \"", plot.title, "\" has no points");
    const Axis x(plot.x_scale, xs, left, width - right);
    const Axis y(plot.y_scale, ys, height - bottom, top);
    std::ostringstream svg;
    svg << std::fixed << std::setprecision(1);
    svg << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " << width << " " << height
        << "\" font-family=\"sans-serif\">\n<rect width=\"" << width << "\" height=\"" << height
        << "\" fill=\"#ffffff\"/>\n";
    write_axes(svg, plot, x, y);
    for (std::size_t i = 0; i < plot.series.size(); ++i) write_series(svg, plot.series[i], i, x, y);
    svg << "</svg>\n";
    return svg.str();
}

}  // namespace stymo
