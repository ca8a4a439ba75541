#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "apps/bench/svg_plot.h"
#include "core/error.h"

namespace {

using stymo::Plot;

Plot plot_of(std::vector<stymo::PlotPoint> points) {
    return {.title = "t", .x_label = "x, ms", .y_label = "y", .series = {{"s", std::move(points)}}};
}

/// Numbers behind `key` in order of appearance: cx="12.3".
std::vector<double> numbers_of(const std::string& svg, const std::string& key) {
    std::vector<double> numbers;
    for (std::size_t at = svg.find(key); at != std::string::npos; at = svg.find(key, at + 1))
        numbers.push_back(std::stod(svg.substr(at + key.size())));
    return numbers;
}

/// Whether every tag is closed, innermost first.
bool tags_match(const std::string& svg) {
    std::vector<std::string> open;
    for (std::size_t at = svg.find('<'); at != std::string::npos; at = svg.find('<', at + 1)) {
        const std::string tag = svg.substr(at + 1, svg.find('>', at) - at - 1);
        if (tag.ends_with('/')) continue;
        if (tag.starts_with('/')) {
            if (open.empty() || open.back() != tag.substr(1)) return false;
            open.pop_back();
        } else {
            open.push_back(tag.substr(0, tag.find(' ')));
        }
    }
    return open.empty();
}

}  // namespace

TEST_CASE("Equal factors are equal distances on the axes of a plot") {
    const std::string svg =
        stymo::to_svg(plot_of({{1.0, 0.001, "a"}, {10.0, 0.01, "b"}, {100.0, 0.1, "c"}}));
    const std::vector<double> x = numbers_of(svg, "<circle cx=\""), y = numbers_of(svg, "cy=\"");
    REQUIRE(x.size() == 4);  // the fourth is the legend's
    CHECK(x[1] - x[0] == Approx(x[2] - x[1]).margin(0.11));
    CHECK(y[0] - y[1] == Approx(y[1] - y[2]).margin(0.11));
    CHECK(x[1] > x[0]);
    CHECK(y[1] < y[0]);
}

TEST_CASE("A plot is well-formed whatever its texts hold") {
    Plot plot = plot_of({{2.0, 3.0, "a < b & \"c\""}});
    plot.title = "<script>";
    const std::string svg = stymo::to_svg(plot);
    CHECK(tags_match(svg));
    CHECK(svg.find("<script>") == std::string::npos);
    CHECK_THAT(svg, Catch::Contains("a &lt; b &amp; &quot;c&quot;") && Catch::Contains("x, ms"));
    CHECK_FALSE(tags_match(svg + "<text>"));
}

TEST_CASE("A plot of nothing, or of what logarithmic axes do not have, is refused") {
    const double infinite = std::numeric_limits<double>::infinity();
    CHECK_THROWS_AS(stymo::to_svg({}), stymo::ValueError);
    CHECK_THROWS_AS(stymo::to_svg(plot_of({{0.0, 1.0}})), stymo::ValueError);
    CHECK_THROWS_AS(stymo::to_svg(plot_of({{1.0, -1.0}})), stymo::ValueError);
    CHECK_THROWS_AS(stymo::to_svg(plot_of({{infinite, 1.0}})), stymo::ValueError);
}

TEST_CASE("Equal steps are equal distances on linear axes, which take zero and negative numbers") {
    Plot plot = plot_of({{0.0, -3.0, ""}, {1.0, 0.0, ""}, {2.0, 3.0, ""}});
    plot.x_scale = plot.y_scale = stymo::PlotScale::linear;
    const std::string svg = stymo::to_svg(plot);
    const std::vector<double> x = numbers_of(svg, "<circle cx=\""), y = numbers_of(svg, "cy=\"");
    REQUIRE(x.size() == 4);
    CHECK(x[1] - x[0] == Approx(x[2] - x[1]).margin(0.11));
    CHECK(y[0] - y[1] == Approx(y[1] - y[2]).margin(0.11));
    CHECK_THAT(svg, Catch::Contains(">-2</text>") && Catch::Contains(">0.5</text>"));
    CHECK(tags_match(svg));
}

TEST_CASE("A linear axis on which all numbers are one number has an extent") {
    for (const double value : {0.0, 5.0, -1e9}) {
        Plot plot = plot_of({{value, value, ""}});
        plot.x_scale = plot.y_scale = stymo::PlotScale::linear;
        CHECK_THAT(stymo::to_svg(plot), !Catch::Contains("nan") && !Catch::Contains("inf"));
    }
}
