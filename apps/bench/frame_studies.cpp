#include <algorithm>
#include <cmath>
#include <memory>

#include "apps/bench/study.h"
#include "core/matmul_precision.h"

/// The study of frames: error against time.
namespace stymo {

namespace {

/// A frame, by what differs from the exact one.
struct FrameVariant {
    std::string varied;
    std::string value;
    RendererOptions options;
    MatmulPrecision precision = MatmulPrecision::highest;
};

/// The exact frame first.
std::vector<FrameVariant> frame_variants(const BenchOptions& bench) {
    const RendererOptions exact{.mode = RenderMode::exact, .samples_per_ray = bench.samples};
    std::vector<FrameVariant> variants{{"exact", "", exact}};
    const auto add = [&](const std::string& varied, const std::string& value, RenderMode mode,
                         auto RendererOptions::*option, auto number) {
        FrameVariant& next = variants.emplace_back(varied, value, exact);
        next.options.mode = mode;
        next.options.*option = number;
    };
    for (const std::int64_t part : {8, 4, 2}) {
        const std::int64_t samples = bench.samples / part;
        if (samples < 2) continue;
        add("samples per ray", std::to_string(samples), RenderMode::exact,
            &RendererOptions::samples_per_ray, samples);
    }
    for (const double tolerance : {0.5, 0.25, 0.12, 0.06, 0.03, 0.01})
        add("tolerance", significant(tolerance, 4), RenderMode::skip, &RendererOptions::tolerance,
            tolerance);
    // Frames that skip round the operands of their render blocks unless highest is chosen.
    for (FrameVariant& variant : variants)
        if (variant.options.mode == RenderMode::skip) variant.precision = MatmulPrecision::high;
    add("tolerance in float32", significant(default_tolerance, 4), RenderMode::skip,
        &RendererOptions::tolerance, default_tolerance);
    for (const auto precision : {MatmulPrecision::high, MatmulPrecision::medium})
        if (computed_precision(precision) == precision)
            variants.push_back({"products", name_of(precision), exact, precision});
    return variants;
}

/// Fewer faces and views where frames take long, so that the study keeps to its seconds.
BenchOptions affordable(const StudyInputs& inputs) {
    BenchOptions bench = inputs.bench;
    if (!std::isfinite(inputs.seconds)) return bench;
    bench.faces = 1;
    const BenchSubject subject = make_subject(bench);
    bench.faces = std::min(inputs.bench.faces, 3);
    const std::vector<FrameVariant> variants = frame_variants(bench);
    FaceRenderer renderer(subject.model, variants.front().options);
    const double seconds = time_frames(subject, renderer, 1).median();
    // Most frames take a fraction of the exact frame's time; what they save pays for the grids.
    const double frames = inputs.seconds / (static_cast<double>(variants.size()) * seconds);
    const auto timed = static_cast<double>(bench.faces * (bench.repeats + 1));
    bench.views = static_cast<int>(
        std::clamp((frames - timed) / bench.faces, 2.0, static_cast<double>(bench.views)));
    return bench;
}

StudyPlan rendering_plan(const StudyInputs& inputs) {
    const BenchOptions bench = affordable(inputs);
    const auto subject = std::make_shared<const BenchSubject>(make_subject(bench));
    const std::vector<FrameVariant> variants = frame_variants(bench);
    const auto images_of = [subject](const FrameVariant& variant) {
        const PrecisionScope scope(variant.precision);
        return all_images(*subject, variant.options);
    };
    const auto exact = std::make_shared<const Images>(images_of(variants.front()));
    const auto exact_seconds = std::make_shared<double>(0.0);
    StudyPlan plan;
    for (const FrameVariant& variant : variants)
        plan.add({variant.varied, variant.value}, [=]() -> Row {
            const PrecisionScope scope(variant.precision);
            FaceRenderer renderer(subject->model, variant.options);
            const double seconds = time_frames(*subject, renderer, bench.repeats).median();
            if (*exact_seconds == 0.0) *exact_seconds = seconds;
            const ImageError error = error_of(images_of(variant), *exact);
            return {seconds,          *exact_seconds / seconds, error.psnr_mean,
                    error.psnr_worst, error.root_mean_square,   error.worst_pixel};
        });
    plan.setting =
        "Frames of " + std::to_string(subject->model.config().decoder.resolution) +
        " pixels with " + std::to_string(bench.samples) +
        " samples per ray: " + std::to_string(subject->codes.batch()) + " faces from " +
        std::to_string(bench.views) +
        " views each. The worst pixel is the largest difference in any colour (white is 1).";
    return plan;
}

/// For each quality of the worst image, the fastest of the frames that reach it.
Table fastest(const Table& curve) {
    Table table{"fastest", {"wanted_db", "fastest", "median_seconds", "psnr_worst_db"}};
    for (const std::int64_t wanted : {35, 40, 45, 50, 55, 60}) {
        const auto psnr = [&](const Row& row) { return number(curve, row, "psnr_worst_db"); };
        const auto seconds = [&](const Row& row) { return number(curve, row, "median_seconds"); };
        const Row* best = &curve.rows.front();
        for (const Row& row : curve.rows)
            if (psnr(row) >= static_cast<double>(wanted) && seconds(row) < seconds(*best))
                best = &row;
        const std::string value = words(curve, *best, "value");
        table.rows.push_back({wanted,
                              words(curve, *best, "varied") + (value.empty() ? "" : " ") + value,
                              seconds(*best), psnr(*best)});
    }
    return table;
}

}  // namespace

Study rendering_study() {
    return {.part = "rendering",
            .name = "curve",
            .title = "Rendering",
            .varied =
                "samples per ray, tolerance with render blocks in bfloat16 and in float32, "
                "precision of products",
            .measured =
                "median time of a frame, each of another view than the one before; error "
                "of the images",
            .reference = "the exact frames of the same codes",
            .columns = {"varied", "value", "median_seconds", "times_exact", "psnr_mean_db",
                        "psnr_worst_db", "root_mean_square_error", "worst_pixel"},
            .plan = rendering_plan,
            .summary = fastest,
            .seconds = 100.0,
            .needs_model = true};
}

}  // namespace stymo
