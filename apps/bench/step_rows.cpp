#include <algorithm>
#include <cmath>
#include <span>

#include "apps/bench/study.h"
#include "core/autograd/grad.h"
#include "core/clock.h"
#include "core/kernels/conv_algorithms.h"
#include "core/kernels/gemm.h"
#include "core/matmul_precision.h"
#include "core/parallel.h"
#include "fit/fitter.h"
#include "nn/losses.h"
#include "nn/models/discriminator.h"
#include "nn/optim/adam.h"
#include "nn/pretrained/perceptual/trunk.h"
#include "train/step_gradients.h"

/// The rows on steps of fitting and training, and on a layer of the field by itself.
namespace stymo {

namespace {

constexpr const char* vgg16 = "vgg16";

/// The model's loss with LPIPS of VGG-16 or without. Its weights are random ones: they do not
/// change the time.
ReconstructionLoss loss_of(const ModelConfig& config, bool perceptual) {
    ReconstructionConfig loss = config.reconstruction;
    if (!perceptual) loss.perceptual_weight = 0.0;
    if (perceptual && loss.perceptual_weight == 0.0) loss.perceptual_weight = 0.1;
    loss.perceptual = {.network = vgg16, .trunk = "random", .heads = "random"};
    return ReconstructionLoss(loss);
}

double trunk_work(const ModelConfig& config, bool perceptual) {
    const std::int64_t side = config.decoder.resolution;
    return perceptual ? static_cast<double>(trunk_multiply_adds(vgg16, side)) : 0.0;
}

BenchSubject one_face(BenchOptions options) {
    options.faces = 1;
    return make_subject(options);
}

/// Steps are timed in groups that hold one evaluation of all samples each. A step goes forwards
/// and backwards to the codes, which costs as much as forwards again; so does the trunk for the
/// image, while the photo's features are kept.
Measurement fit_step(const BenchOptions& options, bool perceptual, double tolerance) {
    const BenchSubject subject = one_face(options);
    const ModelConfig& config = subject.model.config();
    const ReconstructionLoss loss = loss_of(config, perceptual);
    const FaceBatch batch = make_batch(subject.photos);
    Timing timing;
    double last = 0.0;
    FitOptions fit{.samples_per_ray = options.samples, .tolerance = tolerance};
    const std::int64_t group = tolerance > 0.0 ? fit.selection_interval : 1;
    fit.steps = options.repeats * group + 1;
    fit.on_step = [&](const FitStep& step) {
        if ((step.steps - 1) % group != 0) return;
        if (step.steps > 1) timing.add((seconds_now() - last) / static_cast<double>(group));
        last = seconds_now();
    };
    static_cast<void>(
        fit_codes(subject.model, loss, {batch.input, batch.targets, batch.cameras}, fit));
    const double forward =
        frame_work(subject.model, options.samples) + trunk_work(config, perceptual);
    // Left-out work is not counted, so no share of the peak can be stated.
    return {.timing = timing,
            .work = 2.0 * forward,
            .limit = tolerance > 0.0 ? Limit::none : Limit::float32};
}

/// One step of the first stage on one image, with encoder and optimiser. Of the work only decoder
/// and trunk are counted: forwards and twice as much backwards through the decoder; photo, image
/// and back through the trunk.
Measurement train_step(const BenchOptions& options, bool perceptual) {
    BenchSubject subject = one_face(options);
    TrainConfig config;
    config.model = subject.model.config();
    const ReconstructionLoss loss = loss_of(config.model, perceptual);
    const FaceBatch batch = make_batch(subject.photos);
    subject.model.parameters().set_trainable("", true);
    // The mask branch has a loss of its own, which sets in later.
    subject.model.parameters().set_trainable("decoder.mask.", false);
    const std::vector<Parameter> parameters = subject.model.parameters().trainable();
    Adam adam;
    Rng jitter = Rng(options.seed).split("jitter");
    const auto step = [&] {
        const LossAndGradients result =
            generator_gradients({subject.model, loss, config}, TrainingSchedule(config).position(0),
                                batch, parameters, jitter);
        adam.step(parameters, result.gradients, config.optimizer.learning_rate);
    };
    const double forward = frame_work(subject.model, config.stage1.samples_per_ray) +
                           trunk_work(config.model, perceptual);
    return {.timing = time_repeated(options.repeats, 0.0, step),
            .work = 3.0 * forward,
            .limit = limit_of(matmul_precision()),
            .remark = "with the encoder, which the peer does without"};
}

/// An update of the discriminator by its loss on real images, or by R1, on a batch of four random
/// images.
Measurement discriminator_step(const BenchOptions& options, bool r1) {
    constexpr std::int64_t batch = 4, largest = 256;
    // Forwards and backwards. R1: forwards and to the images, then backwards through both, to the
    // weights and to what each layer was given.
    const double passes = r1 ? 6.0 : 3.0;
    const std::string name = "discriminator";
    const std::int64_t side =
        std::min(largest, one_face(options).model.config().decoder.resolution);
    Rng rng = Rng(options.seed).split(name);
    ParameterStore parameters;
    const Discriminator discriminator({}, side, parameters, name, rng);
    // Only the fromRGB layer of the images' own resolution is used.
    for (std::int64_t s = 64; s < side; s *= 2)
        parameters.set_trainable(name + ".from_rgb" + std::to_string(s) + ".", false);
    const std::vector<Parameter> trained = parameters.trainable();
    const Tensor images = rng.uniform({batch, side, side, 3}, -1.0, 1.0);
    const auto logits = [&](const Variable& x) { return discriminator(x); };
    Adam adam({.beta1 = 0.0, .beta2 = 0.99});
    const auto step = [&] {
        const Variable loss = r1 ? r1_penalty(logits, images) : real_loss(logits(images));
        adam.step(trained, grad(loss, variables_of(trained)), 1e-4);
    };
    return {.timing = time_repeated(options.repeats, 0.0, step),
            .work = passes * batch * static_cast<double>(Discriminator::multiply_adds({}, side))};
}

// A layer of the field, on the samples of an exact frame.
constexpr std::int64_t all_points = 65536;
/// Points whose numbers stay in a cache.
constexpr std::int64_t few_points = 4096;
constexpr std::int64_t width = 256;

Measurement layer(const BenchOptions& options, std::int64_t points, Activation activation,
                  MatmulPrecision precision) {
    const PrecisionScope of_products(precision);
    /// Rows that stay in the second-level cache with the weights.
    constexpr std::int64_t tile = 256;
    Rng rng = Rng(options.seed).split("layer");
    const Tensor weight = rng.normal({width, width}, 0.0, 0.1),
                 bias = rng.normal({width}, 0.0, 0.1),
                 inputs = rng.normal({points * width}, 0.0, 1.0);
    const kernels::PackedMatrix<float> packed(weight.values<float>().data(), width, width, 1,
                                              width);
    Tensor results({points * width});
    const float* const x = inputs.values<float>().data();
    float* const y = results.mutable_values<float>().data();
    const kernels::Epilogue<float> epilogue{.bias = bias.values<float>().data(),
                                            .activation = activation};
    const auto all_tiles = [&] {
        parallel_for(points, tile, [&](std::int64_t begin, std::int64_t end) {
            kernels::multiply_packed(y + begin * width, width,
                                     kernels::LeftMatrix<float>{x + begin * width, width},
                                     end - begin, packed, epilogue);
        });
    };
    return {.timing = time_repeated(options.repeats, 0.1 * options.repeats, all_tiles),
            .work = static_cast<double>(points) * width * width,
            .limit = limit_of(matmul_precision())};
}

/// The root mean square of the differences, relative to that of the exact numbers.
double rounding(const Tensor& result, const Tensor& exact) {
    const std::span<const float> values = result.values<float>();
    const std::span<const double> wanted = exact.values<double>();
    double squares = 0.0, norm = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double difference = static_cast<double>(values[i]) - wanted[i];
        squares += difference * difference;
        norm += wanted[i] * wanted[i];
    }
    return std::sqrt(squares / norm);
}

using Convolve = void (*)(const float*, const float*, const kernels::ConvFinish<float>&, float*,
                          const kernels::ConvGeometry&);

/// A convolution as networks for LPIPS and the discriminator have it, and its rounding.
Measurement convolution(const BenchOptions& options, Convolve convolve) {
    const Shape images{4, 128, 128, 64}, filters{64, 3, 3, 64};
    const kernels::ConvGeometry geometry(images, filters, images, {.padding = 1});
    Rng rng = Rng(options.seed).split("convolution");
    const Tensor x = rng.normal(images, 0.0, 1.0), weight = rng.normal(filters, 0.0, 1.0);
    Tensor y(images);
    const float *const pixels = x.values<float>().data(), *const taps =
                                                              weight.values<float>().data();
    float* const result = y.mutable_values<float>().data();
    Measurement measured{
        .timing = time_repeated(options.repeats, 0.1 * options.repeats,
                                [&] { convolve(pixels, taps, {}, result, geometry); }),
        .work =
            static_cast<double>(geometry.batch * geometry.output_image() * geometry.filter_size())};
    const Tensor exact_x = x.to(DType::float64), exact_weight = weight.to(DType::float64);
    Tensor exact(images, DType::float64);
    kernels::direct_conv2d(exact_x.values<double>().data(), exact_weight.values<double>().data(),
                           {}, exact.mutable_values<double>().data(), geometry);
    measured.remark = "rounding " + significant(rounding(y, exact), 2);
    return measured;
}

}  // namespace

std::vector<SpeedRow> step_rows() {
    const double usual = FitOptions{}.tolerance;
    return {{"fit-step-photometric", "fit", "fitting step without LPIPS",
             with(fit_step, false, usual), "fit"},
            {"fit-step", "fit", "fitting step with LPIPS (VGG-16)", with(fit_step, true, usual),
             "fit-lpips"},
            {"fit-step-exact", "fit", "the same with every sample", with(fit_step, true, 0.0),
             "fit-lpips"},
            {"train-step-photometric", "train", "stage 1, one image, 32 samples, without LPIPS",
             with(train_step, false), "train"},
            {"train-step", "train", "stage 1, one image, 32 samples, LPIPS (VGG-16)",
             with(train_step, true), "train-lpips"},
            {"discriminator-update", "disc", "discriminator on 4 images of 256 pixels",
             with(discriminator_step, false), "disc"},
            {"r1-update", "disc", "its R1 penalty on them", with(discriminator_step, true), "r1"}};
}

std::vector<SpeedRow> kernel_rows() {
    using enum MatmulPrecision;
    return {{"product", "kernels", "65536 x 256 times 256 x 256, float32",
             with(layer, all_points, Activation::none, highest)},
            {"sine-layer", "kernels", "the same with bias and sine",
             with(layer, all_points, Activation::sine, highest)},
            {"sine-layer-medium", "kernels", "the same with operands in bfloat16",
             with(layer, all_points, Activation::sine, medium)},
            {"product-in-cache", "kernels", "4096 x 256 times 256 x 256, float32",
             with(layer, few_points, Activation::none, highest)},
            {"product-high", "kernels", "the same on matrix tiles where the processor has them",
             with(layer, few_points, Activation::none, high)},
            {"product-medium", "kernels", "the same with operands in bfloat16",
             with(layer, few_points, Activation::none, medium)},
            {"convolution", "kernels", "3x3, 64 channels, 4 images of 128 pixels, Winograd",
             with(convolution, kernels::winograd_conv2d)},
            {"convolution-direct", "kernels", "the same as a matrix product",
             with(convolution, kernels::direct_conv2d<float>)}};
}

}  // namespace stymo
