#include "apps/bench/curve.h"

#include <cmath>

#include "core/error.h"
#include "core/interrupt.h"
#include "core/progress.h"

namespace stymo {

namespace {

struct Way {
    std::string series;
    std::string value;
    RendererOptions options;
};

std::string short_number(double value) {
    std::string text = decimal(value, 4);
    text.erase(text.find_last_not_of('0') + 1);
    return text;
}

RendererOptions exact_frame(const BenchOptions& bench) {
    RendererOptions exact;
    exact.mode = RenderMode::exact;
    exact.samples_per_ray = bench.samples;
    return exact;
}

std::vector<Way> all_ways(const BenchOptions& bench) {
    const RendererOptions exact = exact_frame(bench);
    std::vector<Way> ways{{"exact", "", exact}};
    for (const std::int64_t part : {8, 4, 2}) {
        if (bench.samples / part < 2) continue;
        RendererOptions fewer = exact;
        fewer.samples_per_ray = bench.samples / part;
        ways.push_back({"samples per ray", std::to_string(fewer.samples_per_ray), fewer});
    }
    for (const auto& [mode, name] : {std::pair{RenderMode::skip, "tolerance, float32"}, {RenderMode::bf16, "tolerance, bf16"}}) {
        for (const double tolerance : {0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.005}) {
            RendererOptions skipping = exact;
            skipping.mode = mode;
            skipping.tolerance = tolerance;
            ways.push_back({name, short_number(tolerance), skipping});
        }
    }
    for (const std::int64_t cells : {32, 48, 64, 96, 128}) {
        RendererOptions baked = exact;
        baked.mode = RenderMode::baked;
        baked.bake_resolution = cells;
        ways.push_back({"baked, cells a side", std::to_string(cells), baked});
    }
    return ways;
}

}  // namespace

std::vector<CurvePoint> measure_curve(const BenchSubject& subject, const BenchOptions& options) {
    const std::vector<Way> ways = all_ways(options);
    const InterruptGuard guard;
    Progress progress({.title = "curve", .total = std::ssize(ways), .unit = "ways"});
    const Pictures pictures = all_pictures(subject, exact_frame(options));
    std::vector<CurvePoint> points;
    for (const auto& [series, value, way] : ways) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        FaceRenderer renderer(subject.model, way);
        const double seconds = time_frames(subject, renderer, options.repeats).median();
        const PictureError error = error_of(all_pictures(subject, way), pictures);
        points.push_back({series, value, seconds, error});
        progress.update(std::ssize(points));
    }
    progress.finish();
    return points;
}

Cells curve_cells(const std::vector<CurvePoint>& points) {
    Cells cells{{"varied", "value", "ms", "RMS error", "worst pixel", "PSNR dB", "worst"}};
    for (const CurvePoint& point : points)
        cells.push_back({point.series, point.value, decimal(point.seconds * 1e3, 2), decimal(point.error.root_mean_square, 6),
                         decimal(point.error.worst_pixel, 3), decimal(point.error.psnr_mean, 1),
                         decimal(point.error.psnr_worst, 1)});
    return cells;
}

JsonValue to_json(const std::vector<CurvePoint>& points) {
    std::vector<JsonValue> values;
    for (const CurvePoint& point : points)
        values.push_back(JsonValue::object({{"varied", point.series},
                                            {"value", point.value},
                                            {"median_seconds", point.seconds},
                                            {"root_mean_square_error", point.error.root_mean_square},
                                            {"worst_pixel", point.error.worst_pixel},
                                            {"psnr_mean_db", point.error.psnr_mean},
                                            {"psnr_worst_db", point.error.psnr_worst}}));
    return values;
}

Plot curve_plot(const std::vector<CurvePoint>& points, const std::string& title, const std::string& label, PlotScale scale,
                double PictureError::*number) {
    Plot plot{.title = title, .x_label = "time of a frame, ms", .y_label = label, .series = {}, .y_scale = scale};
    for (const CurvePoint& point : points) {
        const double y = point.error.*number;
        if (!std::isfinite(y) || (scale == PlotScale::logarithmic && y <= 0.0)) continue;
        if (plot.series.empty() || plot.series.back().name != point.series) plot.series.push_back({point.series, {}});
        plot.series.back().points.push_back({point.seconds * 1e3, y, point.value});
    }
    return plot;
}

Plot error_plot(const std::vector<CurvePoint>& points) {
    // The exact frame has no error but rounding's.
    return curve_plot(points, "Error against frame time", "root mean square error against the exact frame (white = 1)",
                      PlotScale::logarithmic, &PictureError::root_mean_square);
}

}  // namespace stymo
