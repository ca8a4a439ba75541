#include "apps/bench/report/rendering.h"

#include <algorithm>
#include <cmath>

#include "apps/bench/curve.h"

namespace stymo {

namespace {

/// Fewer faces and views where frames take long, so that the section keeps to its seconds.
BenchOptions affordable(const ReportInputs& inputs) {
    BenchOptions bench = inputs.bench;
    bench.faces = std::min(bench.faces, 3);
    BenchOptions one = bench;
    one.faces = 1;
    const BenchSubject subject = make_subject(one, inputs.seed);
    RendererOptions exact;
    exact.mode = RenderMode::exact;
    exact.samples_per_ray = bench.samples;
    FaceRenderer renderer(subject.model, exact);
    const double seconds = time_frames(subject, renderer, 1).median();
    // Most ways take a fraction of the exact frame's time, and what they save pays for baking.
    constexpr double ways = 23.0;
    const double frames = inputs.seconds / (ways * seconds);
    const double timed = static_cast<double>(bench.faces * (bench.repeats + 1));
    bench.views = static_cast<int>(std::clamp((frames - timed) / bench.faces, 2.0, static_cast<double>(bench.views)));
    return bench;
}

ReportCell decibels(double value) {
    return {std::isfinite(value) ? decimal(value, 1) : "equal", value};
}

std::string name_of(const CurvePoint& point) {
    return point.series + (point.value.empty() ? "" : " " + point.value);
}

void write_points(ReportWriter& report, const std::vector<CurvePoint>& points) {
    const double exact = points.front().seconds;
    std::vector<std::vector<ReportCell>> rows;
    for (const CurvePoint& point : points) {
        const PictureError& error = point.error;
        rows.push_back({point.series,
                        point.value,
                        {decimal(point.seconds * 1e3, 2), point.seconds},
                        {decimal(exact / point.seconds, 1), exact / point.seconds},
                        decibels(error.psnr_mean),
                        decibels(error.psnr_worst),
                        {decimal(error.worst_pixel, 3), error.worst_pixel}});
    }
    report.table("rendering", {"varied", "value", "ms", "times as fast as exact", "PSNR dB", "worst picture's", "worst pixel"},
                 rows);
}

/// What is fastest among the frames whose worst picture is good enough.
void write_fastest(ReportWriter& report, const std::vector<CurvePoint>& points) {
    std::vector<std::vector<ReportCell>> rows;
    for (const int wanted : {35, 40, 45, 50, 55, 60}) {
        const CurvePoint* fastest = &points.front();
        for (const CurvePoint& point : points)
            if (point.error.psnr_worst >= wanted && point.seconds < fastest->seconds) fastest = &point;
        rows.push_back({wanted,
                        name_of(*fastest),
                        {decimal(fastest->seconds * 1e3, 2), fastest->seconds},
                        decibels(fastest->error.psnr_worst)});
    }
    report.heading("The fastest frame whose worst picture has so many decibels");
    report.table("rendering_fastest", {"wanted dB", "fastest", "ms", "worst picture's"}, rows);
}

void write_rendering(ReportWriter& report, const ReportInputs& inputs) {
    const BenchOptions bench = affordable(inputs);
    const BenchSubject subject = make_subject(bench, inputs.seed);
    const std::vector<CurvePoint> points = measure_curve(subject, bench);
    const std::int64_t faces = subject.codes.batch();
    report.text(
        "Frames of " + std::to_string(subject.model.config().decoder.resolution) + " pixels with " +
        std::to_string(bench.samples) + " samples on a ray, " + std::to_string(faces) + " faces from " +
        std::to_string(bench.views) + " sides each, against the exact frames of the same codes. A time is the median over " +
        "the faces, every frame from another side than the one before. The worst pixel is the largest difference in any "
        "colour of any pixel of any picture, white = 1. 16 bits have the tolerance of the samples that they leave out, too.");
    const Plot psnr = curve_plot(points, "PSNR against frame time", "PSNR against the exact frame, dB, mean over the pictures",
                                 PlotScale::linear, &PictureError::psnr_mean);
    const Plot pixel = curve_plot(points, "Worst pixel against frame time", "largest difference in any colour (white = 1)",
                                  PlotScale::logarithmic, &PictureError::worst_pixel);
    if (!psnr.series.empty()) report.plot("rendering_psnr", psnr);
    if (!pixel.series.empty()) report.plot("rendering_worst_pixel", pixel);
    write_points(report, points);
    write_fastest(report, points);
}

}  // namespace

ReportSection rendering_section() {
    constexpr double seconds = 100.0;
    return {.name = "rendering", .title = "Rendering", .seconds = seconds, .needs_model = true, .write = write_rendering};
}

}  // namespace stymo
