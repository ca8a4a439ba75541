#include <algorithm>
#include <cmath>
#include <span>

#include "apps/bench/study.h"
#include "core/autograd/grad.h"
#include "core/clock.h"
#include "core/median.h"
#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "fit/fit_report.h"
#include "nn/adversarial.h"
#include "nn/models/discriminator.h"
#include "train/generator_gradients.h"

/// The study of what jobs leave out.
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

/// All numbers in one row.
Tensor joined(const std::vector<Variable>& variables) {
    std::vector<Variable> rows;
    for (const Variable& variable : variables)
        rows.emplace_back(variable.value().reshaped({1, variable.value().size()}));
    return concat(rows, 1).value();
}

/// What jobs work on: the first face. Jobs leave the model frozen.
struct JobSetup {
    explicit JobSetup(const BenchOptions& bench) : options(bench), subject(make_subject(bench)) {}

    [[nodiscard]] RendererOptions skip(bool mask = false) const {
        return {.mode = RenderMode::skip, .samples_per_ray = options.samples, .mask = mask};
    }
    [[nodiscard]] Tensor shown(FaceRenderer& renderer, const Codes& codes) const {
        renderer.show(codes);
        return renderer.render(subject.views.front()).image;
    }
    [[nodiscard]] Codes dimmed() const {
        constexpr std::size_t light = 3;  // in the order of code_names
        Codes codes = first_row(subject.codes);
        codes.groups[light] = (codes.groups[light] * 0.5).detach();
        return codes;
    }
    [[nodiscard]] FaceBatch face() const { return make_batch(std::span(subject.photos).first(1)); }
    [[nodiscard]] ReconstructionLoss loss(bool perceptual) const {
        ReconstructionConfig config = subject.model.config().reconstruction;
        config.perceptual_weight = perceptual ? negligible_weight : 0.0;
        config.perceptual = {.network = "vgg16", .trunk = "random", .heads = "random"};
        return ReconstructionLoss(config);
    }

    BenchOptions options;
    BenchSubject subject;
};

/// A job that can be done with only the parts that it needs, or with all parts. Both give the same
/// numbers up to rounding.
struct Job {
    std::string name;
    std::string left_out;
    std::function<Tensor(JobSetup& setup, bool everything)> run;
    /// Before each run of what is needed, not part of it; may be empty.
    std::function<void(JobSetup& setup)> before{};
};

/// A face is shown, then its light alone changes.
Job edit_of_light() {
    const auto renderer = std::make_shared<std::unique_ptr<FaceRenderer>>();
    return {"edit of light only",
            "identity and expression: the field, its grid and the feature map",
            [=](JobSetup& setup, bool everything) {
                if (!everything) return setup.shown(**renderer, setup.dimmed());
                FaceRenderer anew(setup.subject.model, setup.skip());
                return setup.shown(anew, setup.dimmed());
            },
            [=](JobSetup& setup) {
                if (!*renderer)
                    *renderer = std::make_unique<FaceRenderer>(setup.subject.model, setup.skip());
                static_cast<void>(setup.shown(**renderer, first_row(setup.subject.codes)));
            }};
}

Tensor rendered(JobSetup& setup, bool everything) {
    FaceRenderer renderer(setup.subject.model, setup.skip(everything));
    return setup.shown(renderer, first_row(setup.subject.codes));
}

Tensor short_fit(JobSetup& setup, bool everything) {
    const FitResult result = fit_codes(setup.subject.model, setup.loss(everything), setup.face(),
                                       {.steps = 3, .samples_per_ray = setup.options.samples});
    return joined({result.fitted.groups.begin(), result.fitted.groups.end()});
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

Tensor stage1_gradients(JobSetup& setup, bool everything) {
    constexpr const char* mask_prefix = "decoder.mask.";
    Model& model = setup.subject.model;
    TrainConfig config;
    config.model = model.config();
    LossConfig& weights = config.loss;
    if (everything)
        weights.mask_weight = weights.opacity_weight = weights.depth_variance_weight =
            weights.code_norm_weight = negligible_weight;
    const ReconstructionLoss loss = setup.loss(false);
    const FaceBatch batch = setup.face();
    model.parameters().set_trainable("", true);
    model.parameters().set_trainable(mask_prefix, everything);
    const std::vector<Parameter> parameters = model.parameters().trainable();
    Rng jitter = Rng(setup.options.seed).split("jitter");
    TrainingPosition position = TrainingSchedule(config).position(0);
    position.mask_loss = everything;
    const LossAndGradients found =
        generator_gradients({model, loss, config}, position, batch, parameters, jitter);
    model.parameters().set_trainable("", false);
    if (everything) discriminate(batch.targets.back(), setup.options.seed);
    std::vector<Variable> compared;
    for (std::size_t i = 0; i < parameters.size(); ++i)
        if (!parameters[i].name().starts_with(mask_prefix)) compared.push_back(found.gradients[i]);
    return joined(compared);
}

Tensor evaluated(JobSetup& setup, bool everything) {
    Model& model = setup.subject.model;
    const ReconstructionLoss loss = setup.loss(everything);
    model.parameters().set_trainable("", everything);
    const FaceBatch batch = setup.face(), target{batch.input, batch.targets, batch.cameras};
    const FitResult result =
        fit_codes(model, loss, target, {.steps = 0, .samples_per_ray = setup.options.samples});
    const FitReport report =
        report_fit(model, target, batch.mask, result, 0, loss.lpips(), everything);
    model.parameters().set_trainable("", false);
    return report.fitted;
}

std::vector<Job> all_jobs() {
    return {
        {"render without mask", "the mask branch", rendered},
        edit_of_light(),
        {"fit without perceptual term, 3 steps", "LPIPS with its network", short_fit},
        {"step of stage 1",
         "the mask branch until its loss sets in, regularisers without weight, the discriminator",
         stage1_gradients},
        {"evaluation of a face",
         "every graph, since the model is frozen, the head mask, and LPIPS, which nobody asked for",
         evaluated}};
}

/// Runs a job once without timing, then up to `repeats` times within a few seconds. If there is no
/// time left, the first run counts. Returns the cells of the row but the error.
Row run_job(const Job& job, JobSetup& setup, bool everything, Tensor& result) {
    constexpr double most_seconds = 2.0;
    WorkCounts work;
    std::vector<double> seconds;
    const double begin = seconds_now();
    for (int i = 0; i <= setup.options.repeats && (i == 0 || seconds_now() - begin < most_seconds);
         ++i) {
        if (!everything && job.before) job.before(setup);
        const WorkMeter meter;
        const double start = seconds_now();
        result = job.run(setup, everything);
        seconds.push_back(seconds_now() - start);
        work = meter.counts();
    }
    if (seconds.size() > 1) seconds.erase(seconds.begin());
    return {work.operations, work.gradient_rules, work.gradients,  work.field_points,
            work.parameters, work.buffers,        work.peak_bytes, median(std::move(seconds))};
}

StudyPlan jobs_plan(const StudyInputs& inputs) {
    BenchOptions bench = inputs.bench;
    bench.faces = 1;
    const auto setup = std::make_shared<JobSetup>(bench);
    StudyPlan plan;
    for (const Job& job : all_jobs()) {
        // Both are run in the first row: the error belongs to it.
        const auto everything = std::make_shared<Row>();
        plan.add({job.name, "what it needs"}, [=] {
            Tensor needed, all;
            Row row = run_job(job, *setup, false, needed);
            *everything = run_job(job, *setup, true, all);
            everything->emplace_back();
            row.emplace_back(relative_difference(needed, all));
            return row;
        });
        plan.add({job.name, "everything"}, [=] { return *everything; });
        plan.setting += "- " + job.name + " leaves out " + job.left_out + ".\n";
    }
    return plan;
}

}  // namespace

Study jobs_study() {
    return {
        .part = "omitted",
        .name = "omitted_jobs",
        .title = "What a job does not need",
        .varied =
            "job, with what it needs and with everything, at a weight of 1e-20 where it "
            "is a loss",
        .measured =
            "the program's counts of its own work (`core/work_counts.h`), time, and "
            "relative difference of the results",
        .reference = "the job with everything",
        .columns = {"job", "done", "operations", "gradient_rules", hidden("gradients"),
                    "field_points", "parameters_made", "buffers", "peak_bytes", "seconds", "error"},
        .plan = jobs_plan,
        .seconds = 30.0,
        .needs_model = true};
}

}  // namespace stymo
