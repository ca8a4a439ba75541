#include <memory>
#include <utility>

#include "apps/bench/report/omitted.h"
#include "core/autograd/grad.h"
#include "core/clock.h"
#include "core/median.h"
#include "core/ops/ops.h"
#include "fit/fit_report.h"
#include "nn/adversarial.h"
#include "nn/models/discriminator.h"
#include "nn/models/view.h"
#include "train/reconstruction_stage.h"

namespace stymo {

namespace {

/// Of a term that is computed but does not count.
constexpr double next_to_nothing = 1e-20;

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
    for (const Variable& variable : variables) rows.emplace_back(variable.value().reshaped({1, variable.value().size()}));
    return concat(rows, 1).value();
}

RendererOptions skip_options(const BenchOptions& options, bool mask) {
    return {.mode = RenderMode::skip, .samples_per_ray = options.samples, .mask = mask};
}

/// From codes to a picture.
Tensor first_picture(const Model& model, const Codes& codes, const Camera& camera, const RendererOptions& options) {
    FaceRenderer renderer(model, options);
    renderer.show(codes);
    return renderer.render(camera).picture;
}

OmittedJob render_without_mask(const BenchSubject& subject, const BenchOptions& options) {
    const auto render = [&subject, options](bool mask) {
        return [&subject, options, mask] {
            return first_picture(subject.model, first_codes(subject), subject.views.front(), skip_options(options, mask));
        };
    };
    return {"render without mask", "the mask branch", render(false), render(true)};
}

/// A face that is shown, whose light alone changes.
class LightEdit {
public:
    LightEdit(const BenchSubject& subject, const BenchOptions& options)
        : subject_(subject), renderer_(subject.model, skip_options(options, false)) {}

    [[nodiscard]] static Codes edited(const BenchSubject& subject) {
        constexpr double dimmed = 0.5;
        Codes codes = first_codes(subject);
        codes.groups[light] = (codes.groups[light] * dimmed).detach();
        return codes;
    }
    [[nodiscard]] Tensor with(const Codes& codes) {
        renderer_.show(codes);
        return renderer_.render(subject_.views.front()).picture;
    }

private:
    const BenchSubject& subject_;
    FaceRenderer renderer_;
};

OmittedJob edit_of_light(const BenchSubject& subject, const BenchOptions& options) {
    const auto edit = std::make_shared<LightEdit>(subject, options);
    return {"edit of light only", "identity and expression: the field, its lattice and the feature map",
            [&subject, edit] { return edit->with(LightEdit::edited(subject)); },
            [&subject, options] {
                return first_picture(subject.model, LightEdit::edited(subject), subject.views.front(),
                                     skip_options(options, false));
            },
            [&subject, edit] { static_cast<void>(edit->with(first_codes(subject))); }};
}

OmittedJob fit_without_perceptual_term(const BenchSubject& subject, const BenchOptions& options) {
    const auto fit = [&subject, options](double perceptual_weight) {
        return [&subject, options, perceptual_weight] {
            const ReconstructionLoss loss(loss_config(subject, perceptual_weight));
            const TrainingBatch batch = make_batch(std::span(subject.photos).first(1));
            const FitResult result = fit_codes(subject.model, loss, {batch.input, batch.targets, batch.cameras},
                                               {.steps = 3, .samples_per_ray = options.samples});
            return joined({result.fitted.groups.begin(), result.fitted.groups.end()});
        };
    };
    return {"fit without perceptual term, 3 steps", "LPIPS with its network", fit(0.0), fit(next_to_nothing)};
}

/// What stage 2 would add to a step: a judgement of the pictures and its gradient.
void judge(const Tensor& pictures, std::uint64_t seed) {
    Rng rng = Rng(seed).split("discriminator");
    ParameterStore parameters;
    const Discriminator discriminator({}, pictures.shape(1), parameters, "discriminator", rng);
    parameters.set_trainable("", false);
    const Variable leaf = Variable::leaf(pictures);
    static_cast<void>(grad(generator_loss(discriminator(leaf)), leaf));
}

Tensor stage1_gradients(BenchSubject& subject, bool everything, std::uint64_t seed) {
    constexpr const char* mask_prefix = "decoder.mask.";
    TrainConfig config;
    config.model = subject.model.config();
    if (everything) {
        config.loss.mask_weight = config.loss.opacity_weight = config.loss.depth_variance_weight = next_to_nothing;
        config.loss.code_norm_weight = next_to_nothing;
    }
    const ReconstructionLoss loss(loss_config(subject, 0.0));
    const TrainingBatch batch = make_batch(std::span(subject.photos).first(1));
    subject.model.parameters().set_trainable("", true);
    subject.model.parameters().set_trainable(mask_prefix, everything);
    const std::vector<Parameter> parameters = subject.model.parameters().trainable();
    Rng jitter = Rng(seed).split("jitter");
    const LossAndGradients found = reconstruction_gradients(subject.model, loss, batch, config, parameters, everything, jitter);
    subject.model.parameters().set_trainable("", false);
    if (everything) judge(batch.targets.back(), seed);
    std::vector<Variable> compared;
    for (std::size_t i = 0; i < parameters.size(); ++i)
        if (!parameters[i].name().starts_with(mask_prefix)) compared.push_back(found.gradients[i]);
    return joined(compared);
}

OmittedJob stage1(BenchSubject& subject, std::uint64_t seed) {
    return {"step of stage 1", "the mask branch until its loss sets in, regularisers without weight, the discriminator",
            [&subject, seed] { return stage1_gradients(subject, false, seed); },
            [&subject, seed] { return stage1_gradients(subject, true, seed); }};
}

Tensor evaluated(BenchSubject& subject, const BenchOptions& options, bool everything) {
    const ReconstructionLoss loss(loss_config(subject, everything ? next_to_nothing : 0.0));
    subject.model.parameters().set_trainable("", everything);
    const TrainingBatch batch = make_batch(std::span(subject.photos).first(1));
    const FitTarget target{batch.input, batch.targets, batch.cameras};
    const FitResult result = fit_codes(subject.model, loss, target, {.steps = 0, .samples_per_ray = options.samples});
    const FitReport report = report_fit(subject.model, target, batch.mask, result, 0, loss.lpips(), everything);
    subject.model.parameters().set_trainable("", false);
    return report.fitted;
}

OmittedJob evaluation(BenchSubject& subject, const BenchOptions& options) {
    return {"evaluation of a face", "every graph, since the model is frozen, the head mask, and LPIPS, which nobody asked for",
            [&subject, options] { return evaluated(subject, options, false); },
            [&subject, options] { return evaluated(subject, options, true); }};
}

}  // namespace

std::vector<OmittedJob> omitted_jobs(BenchSubject& subject, const BenchOptions& options, std::uint64_t seed) {
    return {render_without_mask(subject, options), edit_of_light(subject, options), fit_without_perceptual_term(subject, options),
            stage1(subject, seed), evaluation(subject, options)};
}

JobRun run_job(const std::function<Tensor()>& job, const std::function<void()>& before, int repeats) {
    constexpr double most_seconds = 2.0;
    JobRun run;
    std::vector<double> seconds;
    const double begin = seconds_now();
    // The first one finds memory; it counts where there is no time for another.
    for (int i = 0; i <= repeats && (i == 0 || seconds_now() - begin < most_seconds); ++i) {
        if (before) before();
        const WorkMeter meter;
        const double start = seconds_now();
        run.result = job();
        seconds.push_back(seconds_now() - start);
        run.work = meter.counts();
    }
    if (seconds.size() > 1) seconds.erase(seconds.begin());
    run.seconds = median(std::move(seconds));
    return run;
}

}  // namespace stymo
