#include "apps/bench/case.h"
#include "apps/bench/frames.h"
#include "apps/bench/work.h"
#include "core/ops/ops.h"

namespace stymo {

namespace {

/// A subject with the renderer that shows it.
struct Frames {
    Frames(const BenchRun& run, RenderMode mode)
        : subject(make_subject(run.options, run.seed)),
          options{.mode = mode, .samples_per_ray = run.options.samples},
          renderer(subject.model, options),
          repeats(run.options.repeats) {}

    Timing time() { return time_frames(subject, renderer, repeats); }
    [[nodiscard]] double computed_pixels() const {
        const RenderCounts counts = renderer.counts();
        return counts.pixels > 0 ? static_cast<double>(counts.pixels_computed) /
                                       static_cast<double>(counts.pixels)
                                 : 1.0;
    }
    void measure_error(Measurement& result) const {
        RendererOptions exact = options;
        exact.mode = RenderMode::exact;
        const ImageError error = error_of(all_images(subject, options), all_images(subject, exact));
        result.psnr_mean = error.psnr_mean;
        result.psnr_worst = error.psnr_worst;
    }

    BenchSubject subject;
    RendererOptions options;
    FaceRenderer renderer;
    int repeats;
};

/// Takes the peak memory before anything else is computed.
Measurement measured(Timing timing, double work, Limit limit = Limit::float32) {
    return {.timing = std::move(timing),
            .work = work,
            .limit = limit,
            .peak_memory = peak_memory_mebibytes()};
}

Measurement exact_frame(const BenchRun& run) {
    Frames frames(run, RenderMode::exact);
    return measured(frames.time(), frame_work(frames.subject.model).of_frame(run.options.samples));
}

/// Frames that leave out work, timed and then compared with exact ones.
Measurement reduced_frame(const BenchRun& run, RenderMode mode) {
    Frames frames(run, mode);
    Measurement result =
        measured(frames.time(), 0.0, keeps_float32(mode) ? Limit::float32 : Limit::sixteen_bits);
    const RenderCounts counts = frames.renderer.counts();
    const FrameWork work = frame_work(frames.subject.model);
    result.work = work.field_sample * static_cast<double>(counts.field_samples) +
                  work.rays * work.ray + work.blocks * frames.computed_pixels();
    result.remark =
        percent(static_cast<double>(counts.field_samples) / static_cast<double>(counts.samples)) +
        " of the samples, " + percent(frames.computed_pixels()) + " of the pixels";
    if (!frames.subject.trained)
        result.remark += "; random weights make fog, of which little can be left out";
    frames.measure_error(result);
    return result;
}

/// From new codes to the first image: weights folded, empty space found, one frame.
Measurement first_frame(const BenchRun& run) {
    Frames frames(run, RenderMode::skip);
    double size = 1.0;
    const auto show_next = [&] {
        // A face that has not been shown before, but nearly the same.
        constexpr double shrinkage = 0.999;
        size *= shrinkage;
        Codes codes;
        for (std::size_t group = 0; group < code_sizes.size(); ++group)
            codes.groups[group] = (frames.subject.codes.groups[group] * size).detach();
        frames.renderer.show(codes);
        static_cast<void>(frames.renderer.render(frames.subject.views.front()));
    };
    return measured(time_repeated(run.options.repeats, 0.0, show_next), 0.0, Limit::none);
}

/// New texture and light in every frame, seen by the camera of the frame before.
Timing time_edits(Frames& frames, std::uint64_t seed) {
    constexpr double step = 0.1;
    Rng rng = Rng(seed).split("edits");
    Codes codes;
    for (std::size_t group = 0; group < code_sizes.size(); ++group)
        codes.groups[group] = slice(frames.subject.codes.groups[group], 0, 0, 1).detach();
    const auto show = [&] {
        frames.renderer.show(codes);
        static_cast<void>(frames.renderer.render(frames.subject.views.front()));
    };
    show();
    return time_repeated(frames.repeats, 0.1 * frames.repeats, [&] {
        for (const std::size_t group : {2, 3})
            codes.groups[group] = rng.normal({1, code_sizes[group]}, 0.0, step);
        show();
    });
}

Measurement appearance_edit(const BenchRun& run, RenderMode mode) {
    Frames frames(run, mode);
    Measurement result = measured(time_edits(frames, run.seed), 0.0);
    result.work = frame_work(frames.subject.model).blocks * frames.computed_pixels();
    result.remark = percent(frames.computed_pixels()) + " of the pixels";
    return result;
}

/// The field's part of an exact frame. An edit of the appearance costs the rest.
Measurement radiance_field(const BenchRun& run) {
    Frames frames(run, RenderMode::exact);
    Timing timing = frames.time();
    const double rest = time_edits(frames, run.seed).median();
    for (double& seconds : timing.seconds) seconds -= rest;
    Measurement result =
        measured(std::move(timing), frame_work(frames.subject.model).of_field(run.options.samples));
    result.remark = "exact frame without what an appearance edit takes";
    return result;
}

Measurement bake(const BenchRun& run) {
    const Frames frames(run, RenderMode::baked);
    const double before = peak_memory_mebibytes();
    const auto bake_anew = [&] {
        FaceRenderer renderer(frames.subject.model, frames.options);
        renderer.show(frames.subject.codes);
        static_cast<void>(renderer.render(frames.subject.views.front()));
    };
    Measurement result =
        measured(time_repeated(run.options.repeats, 0.0, bake_anew), 0.0, Limit::none);
    result.remark = decimal(result.peak_memory - before, 0) +
                    " MiB beyond model and program; with the first view";
    return result;
}

Measurement baked_view(const BenchRun& run) {
    Frames frames(run, RenderMode::baked);
    Measurement result = measured(frames.time(), 0.0, Limit::none);
    frames.measure_error(result);
    return result;
}

}  // namespace

std::vector<BenchCase> frame_cases() {
    return {
        {"exact-frame", "render", "frame with every sample, float32", exact_frame, "render"},
        {"exact-frame-one-thread", "render", "the same on one thread", exact_frame, "render", 1},
        {"radiance-field", "render", "the field of an exact frame alone", radiance_field},
        {"skip-frame", "render", "frame that skips empty samples, float32",
         [](const BenchRun& run) { return reduced_frame(run, RenderMode::skip); }, "render"},
        {"half-frame", "render", "the same with weights and activations of 16 bits",
         [](const BenchRun& run) { return reduced_frame(run, RenderMode::half); }, "render"},
        {"first-frame", "render", "new codes and their first frame", first_frame},
        {"edit-exact", "edit", "texture and light of a shown view, every pixel",
         [](const BenchRun& run) { return appearance_edit(run, RenderMode::exact); }},
        {"edit-skip", "edit", "texture and light of a shown view",
         [](const BenchRun& run) { return appearance_edit(run, RenderMode::skip); }},
        {"bake", "bake", "one head baked, and its first view", bake},
        {"baked-view", "bake", "view of a baked head", baked_view, "render"},
    };
}

}  // namespace stymo
