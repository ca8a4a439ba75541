#include "apps/bench/case.h"
#include "apps/bench/frames.h"
#include "apps/bench/report.h"
#include "apps/bench/work.h"
#include "core/ops/ops.h"

namespace stymo {

namespace {

RendererOptions renderer_options(const BenchOptions& options, RenderMode mode) {
    RendererOptions result;
    result.mode = mode;
    result.samples_per_ray = options.samples;
    return result;
}

std::string percent(std::int64_t part, std::int64_t whole) {
    return decimal(whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0.0, 0) + " %";
}

void measure_error(Measurement& result, const BenchSubject& subject, const RendererOptions& options) {
    RendererOptions exact = options;
    exact.mode = RenderMode::exact;
    const PictureError error = error_of(all_pictures(subject, options), all_pictures(subject, exact));
    result.psnr_mean = error.psnr_mean;
    result.psnr_worst = error.psnr_worst;
}

Measurement exact_frame(const BenchRun& run) {
    const BenchSubject subject = make_subject(run.options, run.seed);
    FaceRenderer renderer(subject.model, renderer_options(run.options, RenderMode::exact));
    Measurement result{.timing = time_frames(subject, renderer, run.options.repeats),
                       .work = frame_work(subject.model).of_frame(run.options.samples)};
    result.peak_memory = peak_memory_mebibytes();
    return result;
}

/// Frames that leave out work, timed and then held against exact ones.
Measurement reduced_frame(const BenchRun& run, RenderMode mode) {
    const BenchSubject subject = make_subject(run.options, run.seed);
    const RendererOptions options = renderer_options(run.options, mode);
    FaceRenderer renderer(subject.model, options);
    Measurement result{.timing = time_frames(subject, renderer, run.options.repeats)};
    result.peak_memory = peak_memory_mebibytes();
    const RenderCounts counts = renderer.counts();
    const FrameWork work = frame_work(subject.model);
    const double pixels =
        counts.pixels > 0 ? static_cast<double>(counts.pixels_computed) / static_cast<double>(counts.pixels) : 1.0;
    result.work = work.field_sample * static_cast<double>(counts.field_samples) + work.rays * work.ray + work.blocks * pixels;
    if (mode == RenderMode::bf16) result.limit = Limit::sixteen_bits;
    result.remark = percent(counts.field_samples, counts.samples) + " of the samples, " +
                    percent(counts.pixels_computed, counts.pixels) + " of the pixels";
    if (!subject.trained) result.remark += "; random weights are fog, of which little can be left out";
    measure_error(result, subject, options);
    return result;
}

Measurement skip_frame(const BenchRun& run) {
    return reduced_frame(run, RenderMode::skip);
}
Measurement bf16_frame(const BenchRun& run) {
    return reduced_frame(run, RenderMode::bf16);
}

/// From new codes to the first picture: weights folded, empty space found, one frame.
Measurement first_frame(const BenchRun& run) {
    const BenchSubject subject = make_subject(run.options, run.seed);
    FaceRenderer renderer(subject.model, renderer_options(run.options, RenderMode::skip));
    double size = 1.0;
    const auto show_next = [&] {
        // A face that has not been shown before, but nearly the same.
        constexpr double shrinkage = 0.999;
        size *= shrinkage;
        Codes codes;
        for (std::size_t group = 0; group < code_sizes.size(); ++group)
            codes.groups[group] = (subject.codes.groups[group] * size).detach();
        renderer.show(codes);
        static_cast<void>(renderer.render(subject.views.front()));
    };
    Measurement result{.timing = time_repeated(run.options.repeats, 0.0, show_next), .limit = Limit::none};
    result.peak_memory = peak_memory_mebibytes();
    return result;
}

/// New codes of two groups in every frame, seen by the camera of the frame before.
Timing time_edits(const BenchSubject& subject, FaceRenderer& renderer, std::uint64_t seed, int repeats) {
    constexpr double step = 0.1;
    Rng rng = Rng(seed).split("edits");
    Codes codes;
    for (std::size_t group = 0; group < code_sizes.size(); ++group)
        codes.groups[group] =
            Tensor::from({1, code_sizes[group]},
                         subject.codes.groups[group].value().values<float>().first(static_cast<std::size_t>(code_sizes[group])));
    renderer.show(codes);
    static_cast<void>(renderer.render(subject.views.front()));
    return time_repeated(repeats, 0.5, [&] {
        codes.groups[2] = rng.normal({1, code_sizes[2]}, 0.0, step);
        codes.groups[3] = rng.normal({1, code_sizes[3]}, 0.0, step);
        renderer.show(codes);
        static_cast<void>(renderer.render(subject.views.front()));
    });
}

Measurement appearance_edit(const BenchRun& run, RenderMode mode) {
    const BenchSubject subject = make_subject(run.options, run.seed);
    FaceRenderer renderer(subject.model, renderer_options(run.options, mode));
    Measurement result{.timing = time_edits(subject, renderer, run.seed, run.options.repeats)};
    result.peak_memory = peak_memory_mebibytes();
    const RenderCounts counts = renderer.counts();
    const double pixels =
        counts.pixels > 0 ? static_cast<double>(counts.pixels_computed) / static_cast<double>(counts.pixels) : 1.0;
    result.work = frame_work(subject.model).blocks * pixels;
    result.remark = percent(counts.pixels_computed, counts.pixels) + " of the pixels";
    return result;
}

Measurement exact_edit(const BenchRun& run) {
    return appearance_edit(run, RenderMode::exact);
}
Measurement skip_edit(const BenchRun& run) {
    return appearance_edit(run, RenderMode::skip);
}

/// What of an exact frame is the field: an edit of the appearance is all the rest.
Measurement radiance_field(const BenchRun& run) {
    const BenchSubject subject = make_subject(run.options, run.seed);
    FaceRenderer renderer(subject.model, renderer_options(run.options, RenderMode::exact));
    Timing frames = time_frames(subject, renderer, run.options.repeats);
    const double rest = time_edits(subject, renderer, run.seed, run.options.repeats).median();
    for (double& seconds : frames.seconds) seconds -= rest;
    return {.timing = frames,
            .work = frame_work(subject.model).of_field(run.options.samples),
            .peak_memory = peak_memory_mebibytes(),
            .remark = "exact frame without what an appearance edit takes"};
}

Measurement bake(const BenchRun& run) {
    const BenchSubject subject = make_subject(run.options, run.seed);
    const double before = peak_memory_mebibytes();
    const auto bake_anew = [&] {
        FaceRenderer renderer(subject.model, renderer_options(run.options, RenderMode::baked));
        renderer.show(subject.codes);
        static_cast<void>(renderer.render(subject.views.front()));
    };
    Measurement result{.timing = time_repeated(run.options.repeats, 0.0, bake_anew), .limit = Limit::none};
    result.peak_memory = peak_memory_mebibytes();
    result.remark = decimal(result.peak_memory - before, 0) + " MiB beyond model and program; with the first view";
    return result;
}

Measurement baked_view(const BenchRun& run) {
    const BenchSubject subject = make_subject(run.options, run.seed);
    const RendererOptions options = renderer_options(run.options, RenderMode::baked);
    FaceRenderer renderer(subject.model, options);
    Measurement result{.timing = time_frames(subject, renderer, run.options.repeats), .limit = Limit::none};
    result.peak_memory = peak_memory_mebibytes();
    measure_error(result, subject, options);
    return result;
}

}  // namespace

std::vector<BenchCase> frame_cases() {
    return {
        {.name = "exact-frame",
         .command = "render",
         .what = "frame with every sample, float32",
         .peer = "render",
         .measure = exact_frame},
        {.name = "exact-frame-one-thread",
         .command = "render",
         .what = "the same on one thread",
         .peer = "render",
         .threads = 1,
         .measure = exact_frame},
        {.name = "radiance-field", .command = "render", .what = "of it: the field at every sample", .measure = radiance_field},
        {.name = "skip-frame",
         .command = "render",
         .what = "frame without what does not count, float32",
         .peer = "render",
         .measure = skip_frame},
        {.name = "bf16-frame",
         .command = "render",
         .what = "the same with weights and activations of 16 bits",
         .peer = "render",
         .measure = bf16_frame},
        {.name = "first-frame", .command = "render", .what = "new codes and their first frame", .measure = first_frame},
        {.name = "edit-exact",
         .command = "edit",
         .what = "texture and light of a shown view, every pixel",
         .measure = exact_edit},
        {.name = "edit-skip", .command = "edit", .what = "texture and light of a shown view", .measure = skip_edit},
        {.name = "bake", .command = "bake", .what = "one head baked, and its first view", .measure = bake},
        {.name = "baked-view", .command = "bake", .what = "view of a baked head", .peer = "render", .measure = baked_view},
    };
}

}  // namespace stymo
