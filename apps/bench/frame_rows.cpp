#include "apps/bench/speed.h"
#include "core/matmul_precision.h"

/// The rows on frames.
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
    Codes codes = first_row(frames.subject.codes);
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
    const auto with = [](auto measure, RenderMode mode) {
        return [=](const BenchOptions& options) { return measure(options, mode); };
    };
    const auto reduced = [](RenderMode mode, MatmulPrecision precision) {
        return [=](const BenchOptions& options) { return reduced_frame(options, mode, precision); };
    };
    return {
        {"exact-frame", "render", "frame with every sample, float32", exact_frame, "render"},
        {"exact-frame-one-thread", "render", "the same on one thread", exact_frame, "render", 1},
        {"exact-frame-medium", "render", "frame with every sample, operands in bfloat16",
         reduced(RenderMode::exact, MatmulPrecision::medium), "render-bfloat16"},
        {"radiance-field", "render", "the field of an exact frame alone", radiance_field},
        {"skip-frame", "render", "frame of the significant samples, render blocks in bfloat16",
         reduced(RenderMode::skip, MatmulPrecision::high), "render-bfloat16"},
        {"skip-frame-float32", "render", "the same in float32",
         reduced(RenderMode::skip, MatmulPrecision::highest), "render"},
        {"first-frame", "render", "new codes and their first frame", first_frame},
        {"edit-exact", "edit", "texture and light of a shown view, every pixel",
         with(appearance_edit, RenderMode::exact)},
        {"edit-skip", "edit", "texture and light of a shown view",
         with(appearance_edit, RenderMode::skip)}};
}

}  // namespace stymo
