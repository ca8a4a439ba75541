#include <algorithm>
#include <cmath>

#include "apps/bench/frames.h"
#include "apps/bench/study.h"

namespace stymo {

namespace {

struct Way {
    std::string varied;
    std::string value;
    RendererOptions options;
};

std::string short_number(double value) {
    std::string text = decimal(value, 4);
    text.erase(text.find_last_not_of('0') + 1);
    return text;
}

/// The exact frame first.
std::vector<Way> ways_of(const BenchOptions& bench) {
    const RendererOptions exact{.mode = RenderMode::exact, .samples_per_ray = bench.samples};
    std::vector<Way> ways{{"exact", "", exact}};
    for (const std::int64_t part : {8, 4, 2}) {
        if (bench.samples / part < 2) continue;
        RendererOptions fewer = exact;
        fewer.samples_per_ray = bench.samples / part;
        ways.push_back({"samples per ray", std::to_string(fewer.samples_per_ray), fewer});
    }
    for (const auto& [mode, name] : {std::pair{RenderMode::skip, "tolerance, float32"},
                                     {RenderMode::half, "tolerance, half"}}) {
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

/// Fewer faces and views where frames take long, so that the study keeps to its seconds.
BenchOptions affordable(const StudyInputs& inputs) {
    BenchOptions bench = inputs.bench;
    if (!std::isfinite(inputs.seconds)) return bench;
    bench.faces = 1;
    const BenchSubject subject = make_subject(bench, inputs.seed);
    bench.faces = std::min(inputs.bench.faces, 3);
    const std::vector<Way> ways = ways_of(bench);
    FaceRenderer renderer(subject.model, ways.front().options);
    const double seconds = time_frames(subject, renderer, 1).median();
    // Most frames take a fraction of the exact frame's time; what they save pays for baking.
    const double frames = inputs.seconds / (static_cast<double>(ways.size()) * seconds);
    const auto timed = static_cast<double>(bench.faces * (bench.repeats + 1));
    bench.views = static_cast<int>(
        std::clamp((frames - timed) / bench.faces, 2.0, static_cast<double>(bench.views)));
    return bench;
}

Table measured(const BenchSubject& subject, const BenchOptions& bench) {
    const std::vector<Way> ways = ways_of(bench);
    const Images exact = all_images(subject, ways.front().options);
    double exact_seconds = 0.0;
    std::vector<StudyRow> rows;
    for (const Way& way : ways)
        rows.push_back({{way.varied, way.value}, [&, options = way.options]() -> Row {
                            FaceRenderer renderer(subject.model, options);
                            const double seconds =
                                time_frames(subject, renderer, bench.repeats).median();
                            if (exact_seconds == 0.0) exact_seconds = seconds;
                            const ImageError error = error_of(all_images(subject, options), exact);
                            return {seconds,          exact_seconds / seconds, error.psnr_mean,
                                    error.psnr_worst, error.root_mean_square,  error.worst_pixel};
                        }});
    return run_study({.name = "curve",
                      .columns = {{"varied", "varied"},
                                  {"value", "value"},
                                  {"median_seconds", "ms", milliseconds},
                                  {"times_exact", "times as fast", fixed<1>},
                                  {"psnr_mean_db", "PSNR dB", decibels},
                                  {"psnr_worst_db", "worst image", decibels},
                                  {"root_mean_square_error", "RMS error", fixed<6>},
                                  {"worst_pixel", "worst pixel", fixed<3>}}},
                     rows);
}

/// For each quality of the worst image, the fastest of the ways that reach it.
Table fastest(const Table& curve) {
    Table table{.name = "fastest",
                .columns = {{"wanted_db", "at least dB"},
                            {"fastest", "fastest"},
                            {"median_seconds", "ms", milliseconds},
                            {"psnr_worst_db", "worst image", decibels}}};
    for (const std::int64_t wanted : {35, 40, 45, 50, 55, 60}) {
        const auto psnr = [&](const Row& row) { return curve.number(row, "psnr_worst_db"); };
        const auto seconds = [&](const Row& row) { return curve.number(row, "median_seconds"); };
        const Row* best = &curve.rows.front();
        for (const Row& row : curve.rows)
            if (psnr(row) >= static_cast<double>(wanted) && seconds(row) < seconds(*best))
                best = &row;
        const std::string value = curve.words(*best, "value");
        table.rows.push_back({wanted,
                              curve.words(*best, "varied") + (value.empty() ? "" : " ") + value,
                              seconds(*best), psnr(*best)});
    }
    return table;
}

void write_rendering(Page& page, const StudyInputs& inputs) {
    const BenchOptions bench = affordable(inputs);
    const BenchSubject subject = make_subject(bench, inputs.seed);
    const Table curve = measured(subject, bench);
    page.text(
        "Frames of " + std::to_string(subject.model.config().decoder.resolution) + " pixels with " +
        std::to_string(bench.samples) + " samples per ray: " +
        std::to_string(subject.codes.batch()) + " faces from " + std::to_string(bench.views) +
        " views each, compared with the exact frames of the same codes. A time is the median; "
        "every frame shows another view than the one before. The worst pixel is the largest "
        "difference in any colour of any image (white is 1). The mode half skips samples by "
        "the same tolerance.");
    const auto plot = [&](const char* name, const char* title, const char* label, const char* key,
                          PlotScale scale) {
        page.plot(name, plot_of(curve,
                                {.series = "varied",
                                 .x = "median_seconds",
                                 .y = key,
                                 .label = "value",
                                 .x_unit = 1e-3},
                                {.title = title,
                                 .x_label = "time of a frame, ms",
                                 .y_label = label,
                                 .series = {},
                                 .y_scale = scale}));
    };
    plot("error_against_time", "Error against frame time",
         "root mean square error against the exact frame (white = 1)", "root_mean_square_error",
         PlotScale::logarithmic);
    plot("rendering_psnr", "PSNR against frame time",
         "PSNR against the exact frame, dB, mean over the images", "psnr_mean_db",
         PlotScale::linear);
    plot("rendering_worst_pixel", "Worst pixel against frame time",
         "largest difference in any colour (white = 1)", "worst_pixel", PlotScale::logarithmic);
    page.add(curve);
    page.text("The fastest frame whose worst image has at least this PSNR:");
    page.add(fastest(curve));
}

}  // namespace

Study rendering_study() {
    return {.name = "rendering",
            .title = "Rendering",
            .seconds = 100.0,
            .needs_model = true,
            .write = write_rendering};
}

}  // namespace stymo
