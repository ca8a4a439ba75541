#include <algorithm>
#include <cmath>
#include <memory>

#include "apps/bench/study.h"
#include "core/matmul_precision.h"
#include "core/ops/elementwise.h"

/// The rows on frames, and the study of their error against time.
namespace stymo {

namespace {

/// A subject with the renderer that shows it.
struct Frames {
    Frames(const BenchOptions& bench, RenderMode mode)
        : subject(make_subject(bench)),
          options{.mode = mode, .samples_per_ray = bench.samples},
          renderer(subject.model, options),
          repeats(bench.repeats) {}

    Timing time() { return time_frames(subject, renderer, repeats); }
    void show_first(const Codes& codes) {
        renderer.show(codes);
        static_cast<void>(renderer.render(subject.views.front()));
    }
    /// Share of the pixels that the last frame computed.
    [[nodiscard]] double computed_pixels() const {
        const RenderCounts counts = renderer.counts();
        return counts.pixels > 0 ? static_cast<double>(counts.pixels_computed) /
                                       static_cast<double>(counts.pixels)
                                 : 1.0;
    }
    [[nodiscard]] ImageError error() const {
        const Images images = all_images(subject, options);
        RendererOptions exact = options;
        exact.mode = RenderMode::exact;
        const PrecisionScope float32(MatmulPrecision::highest);
        const Images expected = all_images(subject, exact);
        return error_of(images, expected);
    }

    BenchSubject subject;
    RendererOptions options;
    FaceRenderer renderer;
    int repeats;
};

Measurement exact_frame(const BenchOptions& options) {
    Frames frames(options, RenderMode::exact);
    return {.timing = frames.time(), .work = frame_work(frames.subject.model, options.samples)};
}

/// Frames that leave out work or round operands, timed and then compared with exact ones.
Measurement reduced_frame(const BenchOptions& options, RenderMode mode, MatmulPrecision precision) {
    const PrecisionScope of_products(precision);
    Frames frames(options, mode);
    Measurement result{.timing = frames.time(), .limit = limit_of(products_of(mode))};
    const RenderCounts counts = frames.renderer.counts();
    const DecoderWork work = frames.subject.model.decoder().work();
    result.work =
        static_cast<double>(work.field.sample * counts.field_samples + work.rays * work.field.ray) +
        static_cast<double>(work.blocks) * frames.computed_pixels();
    result.remark =
        percent(static_cast<double>(counts.field_samples) / static_cast<double>(counts.samples)) +
        " of the samples, " + percent(frames.computed_pixels()) + " of the pixels";
    if (options.model.empty())
        result.remark += "; random weights make fog, of which little can be left out";
    result.error = frames.error();
    return result;
}

/// From new codes to the first image: weights folded, empty space found, one frame.
Measurement first_frame(const BenchOptions& options) {
    Frames frames(options, RenderMode::skip);
    double size = 1.0;
    const auto show_next = [&] {
        size *= 0.999;  // a face that was not shown before, but nearly the same
        Codes codes = frames.subject.codes;
        for (Variable& group : codes.groups) group = (group * size).detach();
        frames.show_first(codes);
    };
    return {.timing = time_repeated(options.repeats, 0.0, show_next), .limit = Limit::none};
}

/// New texture and light in every frame, seen by the camera of the frame before.
Timing time_edits(Frames& frames, std::uint64_t seed) {
    constexpr double step = 0.1;
    Rng rng = Rng(seed).split("edits");
    Codes codes = codes_of_face(frames.subject.codes, 0);
    frames.show_first(codes);
    return time_repeated(frames.repeats, 0.1 * frames.repeats, [&] {
        for (const std::size_t group : {2, 3})
            codes.groups[group] = rng.normal({1, code_sizes[group]}, 0.0, step);
        frames.show_first(codes);
    });
}

Measurement appearance_edit(const BenchOptions& options, RenderMode mode) {
    Frames frames(options, mode);
    Measurement result{.timing = time_edits(frames, options.seed)};
    result.work = static_cast<double>(frames.subject.model.decoder().work().blocks) *
                  frames.computed_pixels();
    result.remark = percent(frames.computed_pixels()) + " of the pixels";
    return result;
}

/// The field's part of an exact frame. An edit of the appearance costs the rest.
Measurement radiance_field(const BenchOptions& options) {
    Frames frames(options, RenderMode::exact);
    Timing timing = frames.time();
    const double rest = time_edits(frames, options.seed).median();
    for (double& seconds : timing.seconds) seconds -= rest;
    return {.timing = std::move(timing),
            .work = field_work(frames.subject.model, options.samples),
            .remark = "exact frame without what an appearance edit takes"};
}

}  // namespace

std::vector<SpeedRow> frame_rows() {
    using enum MatmulPrecision;
    return {
        {"exact-frame", "render", "frame with every sample, float32", exact_frame, "render"},
        {"exact-frame-one-thread", "render", "the same on one thread", exact_frame, "render", 1},
        {"exact-frame-medium", "render", "frame with every sample, operands in bfloat16",
         with(reduced_frame, RenderMode::exact, medium), "render-bfloat16"},
        {"radiance-field", "render", "the field of an exact frame alone", radiance_field},
        {"skip-frame", "render", "frame of the significant samples, render blocks in bfloat16",
         with(reduced_frame, RenderMode::skip, high), "render-bfloat16"},
        {"skip-frame-float32", "render", "the same in float32",
         with(reduced_frame, RenderMode::skip, highest), "render"},
        {"first-frame", "render", "new codes and their first frame", first_frame},
        {"edit-exact", "edit", "texture and light of a shown view, every pixel",
         with(appearance_edit, RenderMode::exact)},
        {"edit-skip", "edit", "texture and light of a shown view",
         with(appearance_edit, RenderMode::skip)}};
}

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
            .varied = "samples per ray, tolerance (also in float32), precision of products",
            .measured = "median time of a frame of another view than the last; error of images",
            .reference = "the exact frames of the same codes",
            .columns = {"varied", "value", "median_seconds", "times_exact", "psnr_mean_db",
                        "psnr_worst_db", "root_mean_square_error", "worst_pixel"},
            .plan = rendering_plan,
            .summary = fastest,
            .seconds = 100.0,
            .needs_model = true};
}

}  // namespace stymo
