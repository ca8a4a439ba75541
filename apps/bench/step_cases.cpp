#include <algorithm>
#include <utility>

#include "apps/bench/case.h"
#include "apps/bench/work.h"
#include "core/autograd/grad.h"
#include "core/clock.h"
#include "fit/fitter.h"
#include "nn/adversarial.h"
#include "nn/models/discriminator.h"
#include "nn/optim/adam.h"
#include "train/generator_gradients.h"

namespace stymo {

namespace {

constexpr const char* perceptual_network = "vgg16";

/// The model's loss with LPIPS of VGG-16 or without. Its weights are random ones: they do not
/// change the time.
ReconstructionConfig loss_config(const ModelConfig& config, bool perceptual) {
    ReconstructionConfig loss = config.reconstruction;
    constexpr double usual_weight = 0.1;
    if (!perceptual) {
        loss.perceptual_weight = 0.0;
    } else if (loss.perceptual_weight == 0.0) {
        loss.perceptual_weight = usual_weight;
    }
    loss.perceptual = {.network = perceptual_network, .trunk = "random", .heads = "random"};
    return loss;
}

BenchOptions with_one_face(BenchOptions options) {
    options.faces = 1;
    return options;
}

/// Steps are timed in groups that hold one evaluation of all samples each. A step goes forwards
/// and backwards to the codes, which costs as much as forwards again; so does the trunk for the
/// image, while the photo's features are kept.
Measurement fit_step(const BenchRun& run, bool perceptual,
                     double tolerance = FitOptions{}.tolerance) {
    const BenchSubject subject = make_subject(with_one_face(run.options), run.seed);
    const ReconstructionLoss loss(loss_config(subject.model.config(), perceptual));
    const FaceBatch batch = make_batch(subject.photos);
    Measurement result;
    double last = 0.0;
    FitOptions fit{.samples_per_ray = run.options.samples, .tolerance = tolerance};
    const std::int64_t group = tolerance > 0.0 ? fit.selection_interval : 1;
    fit.steps = run.options.repeats * group + 1;
    fit.on_step = [&](const FitStep& step) {
        if ((step.steps - 1) % group != 0) return;
        if (step.steps > 1) result.timing.add((seconds_now() - last) / static_cast<double>(group));
        last = seconds_now();
    };
    static_cast<void>(
        fit_codes(subject.model, loss, {batch.input, batch.targets, batch.cameras}, fit));
    result.peak_memory = peak_memory_mebibytes();
    const double forward =
        frame_work(subject.model).of_frame(run.options.samples) +
        (perceptual ? trunk_work(perceptual_network, subject.model.config().decoder.resolution)
                    : 0.0);
    result.work = 2.0 * forward;
    // Left-out work is not counted, so no share of the peak can be stated.
    if (tolerance > 0.0) result.limit = Limit::none;
    return result;
}

/// One step of the first stage on one image, with encoder and optimiser. Of the work only decoder
/// and trunk are counted: forwards and twice as much backwards through the decoder; photo, image
/// and back through the trunk.
Measurement train_step(const BenchRun& run, bool perceptual) {
    BenchSubject subject = make_subject(with_one_face(run.options), run.seed);
    TrainConfig config;
    config.model = subject.model.config();
    const ReconstructionLoss loss(loss_config(config.model, perceptual));
    const FaceBatch batch = make_batch(subject.photos);
    subject.model.parameters().set_trainable("", true);
    // The mask branch has a loss of its own, which sets in later.
    subject.model.parameters().set_trainable("decoder.mask.", false);
    const std::vector<Parameter> parameters = subject.model.parameters().trainable();
    Adam adam;
    Rng jitter = Rng(run.seed).split("jitter");
    const auto step = [&] {
        const LossAndGradients result =
            generator_gradients({subject.model, loss, config}, TrainingSchedule(config).position(0),
                                batch, parameters, jitter);
        adam.step(parameters, result.gradients, config.optimizer.learning_rate);
    };
    Measurement result{.timing = time_repeated(run.options.repeats, 0.0, step)};
    result.peak_memory = peak_memory_mebibytes();
    result.work =
        3.0 * frame_work(subject.model).of_frame(config.stage1.samples_per_ray) +
        (perceptual ? 3.0 * trunk_work(perceptual_network, config.model.decoder.resolution) : 0.0);
    result.remark = "with the encoder, which the peer does without";
    return result;
}

/// An update of the discriminator by `loss_of`, on a batch of four random images. `passes`: how
/// often the work of a forward pass is done.
template <class Loss>
Measurement discriminator_step(const BenchRun& run, double passes, Loss loss_of) {
    constexpr std::int64_t batch = 4;
    constexpr std::int64_t largest = 256;
    constexpr const char* name = "discriminator";
    const BenchSubject subject = make_subject(with_one_face(run.options), run.seed);
    const std::int64_t side = std::min(largest, subject.model.config().decoder.resolution);
    Rng rng = Rng(run.seed).split(name);
    ParameterStore parameters;
    const Discriminator discriminator({}, side, parameters, name, rng);
    // Only the fromRGB layer of the images' own resolution is used.
    for (std::int64_t s = 64; s < side; s *= 2)
        parameters.set_trainable(name + (".from_rgb" + std::to_string(s)) + ".", false);
    const std::vector<Parameter> trained = parameters.trainable();
    const Tensor images = rng.uniform({batch, side, side, 3}, -1.0, 1.0);
    Adam adam({.beta1 = 0.0, .beta2 = 0.99});
    const auto step = [&] {
        const Variable loss = loss_of(discriminator, images);
        adam.step(trained, grad(loss, variables_of(trained)), 1e-4);
    };
    Measurement result{.timing = time_repeated(run.options.repeats, 0.0, step)};
    result.peak_memory = peak_memory_mebibytes();
    result.work = passes * batch * discriminator_work(parameters, name, side);
    return result;
}

Measurement discriminator_update(const BenchRun& run) {
    constexpr double forward_and_backward = 3.0;
    return discriminator_step(run, forward_and_backward,
                              [](const Discriminator& discriminator, const Tensor& images) {
                                  return real_loss(discriminator(Variable(images)));
                              });
}

Measurement r1_update(const BenchRun& run) {
    // Forwards and to the images, then backwards through both: to the weights and to what each
    // layer was given.
    constexpr double twice_backward = 6.0;
    return discriminator_step(
        run, twice_backward, [](const Discriminator& discriminator, const Tensor& images) {
            return r1_penalty([&](const Variable& x) { return discriminator(x); }, images);
        });
}

}  // namespace

std::vector<BenchCase> step_cases() {
    return {
        {"fit-step-photometric", "fit", "fitting step without LPIPS",
         [](const BenchRun& run) { return fit_step(run, false); }, "fit"},
        {"fit-step", "fit", "fitting step with LPIPS (VGG-16)",
         [](const BenchRun& run) { return fit_step(run, true); }, "fit-lpips"},
        {"fit-step-exact", "fit", "the same with every sample",
         [](const BenchRun& run) { return fit_step(run, true, 0.0); }, "fit-lpips"},
        {"train-step-photometric", "train", "stage 1, one image, 32 samples, without LPIPS",
         [](const BenchRun& run) { return train_step(run, false); }, "train"},
        {"train-step", "train", "stage 1, one image, 32 samples, LPIPS (VGG-16)",
         [](const BenchRun& run) { return train_step(run, true); }, "train-lpips"},
        {"discriminator-update", "disc", "discriminator on 4 images of 256 pixels",
         discriminator_update, "disc"},
        {"r1-update", "disc", "its R1 penalty on them", r1_update, "r1"},
    };
}

}  // namespace stymo
