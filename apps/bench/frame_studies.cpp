#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "apps/bench/study.h"
#include "core/angle.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"
#include "core/work_counts.h"
#include "render/camera.h"

/// Studies of frames: error against time, time against work, and what scenes leave out.
namespace stymo {

namespace {

using Subject = std::shared_ptr<const BenchSubject>;

Subject shared_subject(const BenchOptions& options) {
    return std::make_shared<const BenchSubject>(make_subject(options));
}

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
    const Subject subject = shared_subject(bench);
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

/// Random weights; the encoder takes no part.
BenchSubject with_width(const ModelConfig& model, std::int64_t width, const StudyInputs& inputs) {
    ModelConfig config = model;
    config.encoder.backbone = "small_conv";
    config.encoder.backbone_weights.clear();
    config.decoder.field_width = width;
    BenchOptions random = inputs.bench;
    random.data.clear();
    return random_subject(config, random);
}

struct TimeAndWork {
    double seconds = 0.0;
    double multiply_adds = 0.0;
};

StudyPlan growth_plan(const StudyInputs& inputs) {
    const Subject subject = shared_subject(inputs.bench);
    const std::int64_t samples = inputs.bench.samples;
    const auto exact = [repeats = inputs.bench.repeats](const BenchSubject& shown,
                                                        std::int64_t samples_per_ray,
                                                        std::int64_t resolution) -> TimeAndWork {
        FaceRenderer renderer(shown.model, {.mode = RenderMode::exact,
                                            .samples_per_ray = samples_per_ray,
                                            .resolution = resolution});
        return {time_frames(shown, renderer, repeats).median(),
                frame_work(shown.model, samples_per_ray, resolution)};
    };
    StudyPlan plan;
    const auto vary = [&](const std::string& varied, const std::vector<std::int64_t>& values,
                          const std::function<TimeAndWork(std::int64_t)>& measure) {
        const auto first = std::make_shared<std::optional<TimeAndWork>>();
        for (const std::int64_t value : values)
            plan.add({varied, value}, [=]() -> Row {
                const auto [seconds, work] = measure(value);
                if (!*first) *first = {seconds, work};
                const double times_time = seconds / (*first)->seconds,
                             times_work = work / (*first)->multiply_adds;
                return {seconds, work, times_time, times_work, times_time / times_work};
            });
    };
    const auto doubled = [](std::int64_t from, std::int64_t to) {
        std::vector<std::int64_t> values;
        for (std::int64_t value = from; value <= to; value *= 2) values.push_back(value);
        return values;
    };
    const DecoderConfig& decoder = subject->model.config().decoder;
    const std::int64_t half = std::max<std::int64_t>(decoder.field_width / 2, 1);
    vary("samples per ray", doubled(16, 256),
         [=](std::int64_t count) { return exact(*subject, count, 0); });
    vary("side of the image", doubled(64, decoder.resolution),
         [=](std::int64_t side) { return exact(*subject, samples, side); });
    vary("width of the field", {half, 2 * half, 3 * half}, [=](std::int64_t width) {
        return exact(with_width(subject->model.config(), width, inputs), samples, 0);
    });
    vary("threads", doubled(1, thread_count()), [=, all = thread_count()](std::int64_t threads) {
        set_thread_count(static_cast<int>(threads));
        const TimeAndWork one = exact(*subject, samples, 0);
        set_thread_count(all);
        // The threads do their parts of the work at the same time.
        return TimeAndWork{one.seconds, one.multiply_adds / static_cast<double>(threads)};
    });
    return plan;
}

/// How one head is placed in the frame.
struct Scene {
    std::string name;
    double yaw_degrees = 0.0;
    double distances = 1.0;  ///< distance in units of that of the model's camera
    double shift = 0.0;      ///< to the side, in units of the image's side
    bool empty = false;      ///< the field has no density anywhere
};

Camera camera_of(const Model& model, const Scene& scene, double extra_yaw) {
    const CameraConfig& camera = model.config().camera;
    Pose pose = pivot_pose(radians_from_degrees(scene.yaw_degrees) + extra_yaw, 0.0, 0.0,
                           scene.distances * camera.distance, camera.pivot_depth);
    pose.translation[0] += scene.shift * camera.distance / camera.intrinsics.focal;
    return camera_from_pose(pose, camera.intrinsics);
}

/// The subject with a field without density.
Subject without_density(BenchSubject subject) {
    constexpr double nothing = -60.0;  // softplus(-60) = 1e-26
    for (const Parameter& parameter : subject.model.parameters().all())
        if (parameter.name() == "decoder.field.density.bias")
            parameter.set_value(Tensor::full({1}, nothing));
    return std::make_shared<const BenchSubject>(std::move(subject));
}

/// Frames of a scene in one mode: the counts of one, and the median time of many.
struct SceneFrames {
    Tensor image;
    RenderCounts counts;
    WorkCounts work;
    double seconds = 0.0;
};

SceneFrames frames_of(const BenchSubject& subject, const Scene& scene, RenderMode mode,
                      const BenchOptions& options) {
    constexpr double a_little = 0.002;
    const Camera camera = camera_of(subject.model, scene, 0.0),
                 beside = camera_of(subject.model, scene, a_little);
    FaceRenderer renderer(subject.model, {.mode = mode, .samples_per_ray = options.samples});
    renderer.show(subject.codes);
    // Everything that these views need is now computed and allocated.
    static_cast<void>(renderer.render(camera));
    static_cast<void>(renderer.render(beside));
    SceneFrames frames;
    {
        const WorkMeter meter;
        frames.image = renderer.render(camera).image;
        frames.work = meter.counts();
        frames.counts = renderer.counts();
    }
    bool aside = false;
    frames.seconds = time_repeated(options.repeats, 0.04 * options.repeats, [&] {
                         aside = !aside;
                         static_cast<void>(renderer.render(aside ? beside : camera));
                     }).median();
    return frames;
}

StudyPlan scenes_plan(const StudyInputs& inputs) {
    BenchOptions bench = inputs.bench;
    bench.faces = 1;
    const Subject head = shared_subject(bench), nothing = without_density(make_subject(bench));
    StudyPlan plan;
    for (const Scene& scene :
         {Scene{"frontal"}, Scene{"profile, 70 degrees", 70.0},
          Scene{"twice as far away", 0.0, 2.0}, Scene{"half outside the frame", 0.0, 1.0, 0.5},
          Scene{"empty", 0.0, 1.0, 0.0, true}})
        plan.add({scene.name}, [=]() -> Row {
            const BenchSubject& subject = scene.empty ? *nothing : *head;
            const SceneFrames needed = frames_of(subject, scene, RenderMode::skip, bench),
                              all = frames_of(subject, scene, RenderMode::exact, bench);
            const RenderCounts& counts = needed.counts;
            const ImageError error = error_of({needed.image}, {all.image});
            return {counts.samples,         counts.field_samples,   counts.tiles,
                    counts.pixels,          counts.pixels_computed, counts.layers,
                    counts.layers_computed, needed.work.buffers,    all.seconds,
                    needed.seconds,         error.psnr_worst,       error.worst_pixel};
        });
    return plan;
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

Study growth_study() {
    return {.part = "growth",
            .name = "growth",
            .title = "Growth of a frame's time with its work",
            .varied = "samples per ray, side of the image, width of the field, threads",
            .measured = "median time of an exact frame, and its multiply-adds",
            .reference = "the first value of each quantity",
            .columns = {"varied", "value", "median_seconds", "multiply_adds", "times_time",
                        "times_work", "time_per_work"},
            .plan = growth_plan};
}

Study scenes_study() {
    return {.part = "omitted",
            .name = "omitted_scenes",
            .title = "What a scene does not need",
            .varied = "where the head is in the frame; in the empty scene its field has no density",
            .measured =
                "samples, pixels and layers that are computed, tensors that one more frame "
                "allocates (buffers), time and error of a frame in the mode skip",
            .reference = "the exact frame",
            .columns = {"scene", "samples", "field_samples", hidden("tiles"), "pixels",
                        "pixels_computed", "layers", "layers_computed", "buffers", "seconds_exact",
                        "seconds", "psnr_db", "worst_pixel"},
            .plan = scenes_plan,
            .seconds = 30.0,
            .needs_model = true};
}

}  // namespace stymo
