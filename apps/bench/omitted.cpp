#include <algorithm>
#include <cmath>
#include <memory>

#include "apps/bench/frames.h"
#include "apps/bench/study.h"
#include "core/angle.h"
#include "core/autograd/grad.h"
#include "core/clock.h"
#include "core/median.h"
#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "fit/fit_report.h"
#include "nn/adversarial.h"
#include "nn/models/discriminator.h"
#include "nn/realtime/view.h"
#include "train/generator_gradients.h"

namespace stymo {

namespace {

/// The weight of a term that is computed but does not count.
constexpr double negligible_weight = 1e-20;

/// |a - b| / |b| in the Euclidean norm.
double relative_difference(const Tensor& a, const Tensor& b) {
    const std::vector<double> left = a.to_vector(), right = b.to_vector();
    double squares = 0.0, all = 0.0;
    for (std::size_t i = 0; i < left.size(); ++i) {
        squares += (left[i] - right[i]) * (left[i] - right[i]);
        all += right[i] * right[i];
    }
    return all > 0.0 ? std::sqrt(squares / all) : 0.0;
}

/// A scene: how one head is placed in the frame.
struct Scene {
    std::string name;
    double yaw_degrees = 0.0;
    double distances = 1.0;  ///< distance in units of that of the model's camera
    double shift = 0.0;      ///< to the side, in units of the image's side
    bool empty = false;      ///< the field has no density anywhere
};

Camera camera_of(const Model& model, const Scene& scene, double extra_yaw) {
    const CameraConfig& place = model.config().camera;
    Pose pose = pivot_pose(radians_from_degrees(scene.yaw_degrees) + extra_yaw, 0.0, 0.0,
                           scene.distances * place.distance, place.pivot_depth);
    pose.translation[0] += scene.shift * place.distance / place.intrinsics.focal;
    return camera_from_pose(pose, place.intrinsics);
}

/// Takes all density from the field.
void empty_field(const Model& model) {
    constexpr double nothing = -60.0;  // softplus(-60) = 1e-26
    for (const Parameter& parameter : model.parameters().all())
        if (parameter.name() == "decoder.field.density.bias")
            parameter.set_value(Tensor::full({1}, nothing));
}

/// Frames of a scene in one mode: the counts of one, and the median time of many.
struct SceneFrames {
    Tensor image;
    RenderCounts counts;
    WorkCounts work;
    double seconds = 0.0;
};

SceneFrames frames_of(const Model& model, const Codes& codes, const Scene& scene, RenderMode mode,
                      const BenchOptions& options) {
    constexpr double a_little = 0.002;
    const Camera camera = camera_of(model, scene, 0.0), beside = camera_of(model, scene, a_little);
    FaceRenderer renderer(model, {.mode = mode, .samples_per_ray = options.samples});
    renderer.show(codes);
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

void write_scenes(Page& page, const BenchSubject& subject, const StudyInputs& inputs) {
    BenchSubject without = make_subject(inputs.bench, inputs.seed);
    empty_field(without.model);
    std::vector<StudyRow> rows;
    for (const Scene& scene :
         {Scene{"frontal"}, Scene{"profile, 70 degrees", 70.0},
          Scene{"twice as far away", 0.0, 2.0}, Scene{"half outside the frame", 0.0, 1.0, 0.5},
          Scene{"empty", 0.0, 1.0, 0.0, true}})
        rows.push_back({{scene.name}, [&, scene]() -> Row {
                            const Model& model = scene.empty ? without.model : subject.model;
                            const auto frames = [&](RenderMode mode) {
                                return frames_of(model, subject.codes, scene, mode, inputs.bench);
                            };
                            const SceneFrames needed = frames(RenderMode::skip),
                                              all = frames(RenderMode::exact);
                            const RenderCounts& counts = needed.counts;
                            const ImageError error = error_of({needed.image}, {all.image});
                            return {
                                counts.samples,         counts.field_samples,   counts.tiles,
                                counts.pixels,          counts.pixels_computed, counts.layers,
                                counts.layers_computed, needed.work.buffers,    all.seconds,
                                needed.seconds,         error.psnr_worst,       error.worst_pixel};
                        }});
    const Table scenes = run_study({.name = "omitted_scenes",
                                    .columns = {{"scene", "scene"},
                                                {"samples", "samples"},
                                                {"field_samples", "through the field"},
                                                {"tiles"},
                                                {"pixels", "pixels"},
                                                {"pixels_computed", "computed"},
                                                {"layers", "layers"},
                                                {"layers_computed", "computed"},
                                                {"buffers", "buffers"},
                                                {"seconds_exact", "ms, exact", milliseconds},
                                                {"seconds", "ms, skip", milliseconds},
                                                {"psnr_db", "PSNR dB", decibels},
                                                {"worst_pixel", "worst pixel", fixed<3>}}},
                                   rows);
    page.title(3, "Scenes");
    page.text(
        "Frames with every sample (exact) and frames without the samples that cannot matter "
        "(skip). Every frame shows another view than the one before. Layers are those of "
        "field, render blocks and mask branch; buffers are tensors that one more frame "
        "allocates. The empty scene is the same head with a field without density.");
    page.add(scenes);
}

constexpr std::size_t light = 3;  // in the order of code_names

ReconstructionConfig loss_config(const BenchSubject& subject, double perceptual_weight) {
    ReconstructionConfig loss = subject.model.config().reconstruction;
    loss.perceptual_weight = perceptual_weight;
    loss.perceptual = {.network = "vgg16", .trunk = "random", .heads = "random"};
    return loss;
}

Codes first_codes(const BenchSubject& subject) {
    Codes codes;
    for (std::size_t group = 0; group < code_names.size(); ++group)
        codes.groups[group] = slice(subject.codes.groups[group], 0, 0, 1).detach();
    return codes;
}

/// All numbers in one row.
Tensor joined(const std::vector<Variable>& variables) {
    std::vector<Variable> rows;
    for (const Variable& variable : variables)
        rows.emplace_back(variable.value().reshaped({1, variable.value().size()}));
    return concat(rows, 1).value();
}

RendererOptions skip_options(const BenchOptions& options, bool mask) {
    return {.mode = RenderMode::skip, .samples_per_ray = options.samples, .mask = mask};
}

/// From codes to an image.
Tensor first_image(const BenchSubject& subject, const Codes& codes,
                   const RendererOptions& options) {
    FaceRenderer renderer(subject.model, options);
    renderer.show(codes);
    return renderer.render(subject.views.front()).image;
}

/// A job that can be done with only the parts that it needs, or with all parts. Both give the same
/// numbers up to rounding. Jobs work on the subject's first face and leave its model frozen.
struct Job {
    std::string name;
    std::string left_out;
    std::function<Tensor(bool everything)> run;
    std::function<void()> before{};  ///< each run of what is needed, not part of it; may be empty
};

Job render_without_mask(const BenchSubject& subject, const BenchOptions& options) {
    return {"render without mask", "the mask branch", [&](bool everything) {
                return first_image(subject, first_codes(subject),
                                   skip_options(options, everything));
            }};
}

/// A face is shown, then its light alone changes.
Job edit_of_light(const BenchSubject& subject, const BenchOptions& options) {
    constexpr double dimmed = 0.5;
    const auto renderer =
        std::make_shared<FaceRenderer>(subject.model, skip_options(options, false));
    const auto show = [&subject, renderer](const Codes& codes) {
        renderer->show(codes);
        return renderer->render(subject.views.front()).image;
    };
    const auto edited = [&subject] {
        Codes codes = first_codes(subject);
        codes.groups[light] = (codes.groups[light] * dimmed).detach();
        return codes;
    };
    return {"edit of light only",
            "identity and expression: the field, its grid and the feature map",
            [=, &subject, &options](bool everything) {
                return everything ? first_image(subject, edited(), skip_options(options, false))
                                  : show(edited());
            },
            [=, &subject] { static_cast<void>(show(first_codes(subject))); }};
}

Job fit_without_perceptual_term(const BenchSubject& subject, const BenchOptions& options) {
    return {"fit without perceptual term, 3 steps", "LPIPS with its network", [&](bool everything) {
                const ReconstructionLoss loss(
                    loss_config(subject, everything ? negligible_weight : 0.0));
                const FaceBatch batch = make_batch(std::span(subject.photos).first(1));
                const FitResult result = fit_codes(
                    subject.model, loss, batch, {.steps = 3, .samples_per_ray = options.samples});
                return joined({result.fitted.groups.begin(), result.fitted.groups.end()});
            }};
}

/// What stage 2 would add to a step: the discriminator on the images, and its gradient.
void discriminate(const Tensor& images, std::uint64_t seed) {
    Rng rng = Rng(seed).split("discriminator");
    ParameterStore parameters;
    const Discriminator discriminator({}, images.shape(1), parameters, "discriminator", rng);
    parameters.set_trainable("", false);
    const Variable leaf = Variable::leaf(images);
    static_cast<void>(grad(generator_loss(discriminator(leaf)), leaf));
}

Tensor stage1_gradients(BenchSubject& subject, bool everything, std::uint64_t seed) {
    constexpr const char* mask_prefix = "decoder.mask.";
    TrainConfig config;
    config.model = subject.model.config();
    if (everything) {
        config.loss.mask_weight = config.loss.opacity_weight = config.loss.depth_variance_weight =
            negligible_weight;
        config.loss.code_norm_weight = negligible_weight;
    }
    const ReconstructionLoss loss(loss_config(subject, 0.0));
    const FaceBatch batch = make_batch(std::span(subject.photos).first(1));
    subject.model.parameters().set_trainable("", true);
    subject.model.parameters().set_trainable(mask_prefix, everything);
    const std::vector<Parameter> parameters = subject.model.parameters().trainable();
    Rng jitter = Rng(seed).split("jitter");
    TrainingPosition position = TrainingSchedule(config).position(0);
    position.mask_loss = everything;
    const LossAndGradients found =
        generator_gradients({subject.model, loss, config}, position, batch, parameters, jitter);
    subject.model.parameters().set_trainable("", false);
    if (everything) discriminate(batch.targets.back(), seed);
    std::vector<Variable> compared;
    for (std::size_t i = 0; i < parameters.size(); ++i)
        if (!parameters[i].name().starts_with(mask_prefix)) compared.push_back(found.gradients[i]);
    return joined(compared);
}

Tensor evaluated(BenchSubject& subject, const BenchOptions& options, bool everything) {
    const ReconstructionLoss loss(loss_config(subject, everything ? negligible_weight : 0.0));
    subject.model.parameters().set_trainable("", everything);
    const FaceBatch batch = make_batch(std::span(subject.photos).first(1));
    const FaceBatch target{batch.input, batch.targets, batch.cameras};
    const FitResult result =
        fit_codes(subject.model, loss, target, {.steps = 0, .samples_per_ray = options.samples});
    const FitReport report =
        report_fit(subject.model, target, batch.mask, result, 0, loss.lpips(), everything);
    subject.model.parameters().set_trainable("", false);
    return report.fitted;
}

std::vector<Job> jobs_on(BenchSubject& subject, const BenchOptions& options, std::uint64_t seed) {
    return {
        render_without_mask(subject, options),
        edit_of_light(subject, options),
        fit_without_perceptual_term(subject, options),
        {"step of stage 1",
         "the mask branch until its loss sets in, regularisers without weight, the discriminator",
         [&, seed](bool everything) { return stage1_gradients(subject, everything, seed); }},
        {"evaluation of a face",
         "every graph, since the model is frozen, the head mask, and LPIPS, which nobody asked for",
         [&](bool everything) { return evaluated(subject, options, everything); }}};
}

struct JobRun {
    Tensor result;
    WorkCounts work;
    double seconds = 0.0;  ///< median
};

/// Runs a job once without timing, then up to `repeats` times within a few seconds. If there is no
/// time left, the first run counts.
JobRun run_job(const Job& job, bool everything, int repeats) {
    constexpr double most_seconds = 2.0;
    JobRun run;
    std::vector<double> seconds;
    const double begin = seconds_now();
    for (int i = 0; i <= repeats && (i == 0 || seconds_now() - begin < most_seconds); ++i) {
        if (!everything && job.before) job.before();
        const WorkMeter meter;
        const double start = seconds_now();
        run.result = job.run(everything);
        seconds.push_back(seconds_now() - start);
        run.work = meter.counts();
    }
    if (seconds.size() > 1) seconds.erase(seconds.begin());
    run.seconds = median(std::move(seconds));
    return run;
}

void write_jobs(Page& page, BenchSubject& subject, const StudyInputs& inputs) {
    const std::vector<Job> jobs = jobs_on(subject, inputs.bench, inputs.seed);
    std::vector<JobRun> everything(jobs.size());
    std::vector<StudyRow> rows;
    const auto cells = [](const JobRun& run, const Value& error) -> Row {
        const WorkCounts& work = run.work;
        return {work.operations,   work.gradient_rules, work.gradients,
                work.field_points, work.parameters,     work.buffers,
                work.peak_bytes,   run.seconds,         error};
    };
    std::string left_out;
    for (std::size_t i = 0; i < jobs.size(); ++i) {
        const Job& job = jobs[i];
        rows.push_back({{job.name, "what it needs"}, [&, i] {
                            const JobRun needed = run_job(job, false, inputs.bench.repeats);
                            everything[i] = run_job(job, true, inputs.bench.repeats);
                            return cells(needed,
                                         relative_difference(needed.result, everything[i].result));
                        }});
        rows.push_back({{job.name, "everything"}, [&, i] { return cells(everything[i], {}); }});
        left_out += "- " + job.name + " leaves out " + job.left_out + ".\n";
    }
    const Table table = run_study({.name = "omitted_jobs",
                                   .columns = {{"job", "job"},
                                               {"done", "computed"},
                                               {"operations", "operations"},
                                               {"gradient_rules", "gradient rules"},
                                               {"gradients"},
                                               {"field_points", "field points"},
                                               {"parameters_made", "weights made"},
                                               {"buffers", "buffers"},
                                               {"peak_bytes", "peak MiB", mebibytes},
                                               {"seconds", "ms", milliseconds},
                                               {"error", "error"}}},
                                  rows);
    page.title(3, "Jobs");
    page.text(
        "Each job twice: with what it needs, and with everything that it leaves out computed "
        "too, at a weight of 1e-20 where it is a loss. The program itself counts "
        "(`core/work_counts.h`). Weights made are parameter tensors of networks that were "
        "constructed in the job; the error is the relative difference between the results.");
    page.add(table);
    page.text(left_out);
}

void write_omitted(Page& page, const StudyInputs& inputs) {
    StudyInputs one_face = inputs;
    one_face.bench.faces = 1;
    BenchSubject subject = make_subject(one_face.bench, one_face.seed);
    write_scenes(page, subject, one_face);
    write_jobs(page, subject, one_face);
}

}  // namespace

Study omitted_study() {
    return {.name = "omitted",
            .title = "What a scene or a job does not need",
            .seconds = 60.0,
            .needs_model = true,
            .write = write_omitted};
}

}  // namespace stymo
