#include "nn/losses.h"

#include <algorithm>

#include "cases/stability/case.h"
#include "core/autograd/grad.h"
#include "core/metrics.h"
#include "core/ops/ops.h"
#include "core/rng.h"
#include "nn/models/discriminator.h"
#include "nn/pretrained/perceptual/feature_distance.h"
#include "nn/pretrained/perceptual/lpips.h"

namespace stymo::stability {

namespace {

/// R1 of a small discriminator whose logits are multiplied by `factor`, and its gradient (a second
/// derivative) in every parameter.
StabilityResult regularized(DType dtype, const Tensor& images, double factor) {
    ParameterStore store;
    Rng rng(8);
    const Discriminator discriminator(
        {.channel_multiplier = 0.03125, .max_channels = 8, .group_size = 2}, 64, store, "D", rng);
    store.convert(dtype);
    const auto logits = [&](const Variable& x) { return discriminator(x) * factor; };
    const Variable penalty = r1_penalty(logits, images.to(dtype));
    StabilityResult result{.values = {penalty.value()}};
    for (const Variable& gradient : grad(penalty, variables_of(store.all())))
        result.gradients.push_back(gradient.value());
    return result;
}

std::vector<StabilityCase> adversarial_cases() {
    const Tensor photos = Rng(9).uniform({2, 64, 64, 3}, -1.0, 1.0),
                 nothing = Tensor::zeros({2, 64, 64, 3});
    std::vector<StabilityCase> rows;
    const auto add = [&](std::string name, std::string behaviour, const Tensor& images,
                         double factor) {
        rows.push_back({.name = std::move(name),
                        .behaviour = std::move(behaviour),
                        .value_bound = 1e-4,
                        .gradient_bound = 1e-3,
                        .run = [=](DType dtype) { return regularized(dtype, images, factor); }});
    };
    add("R1 and its gradient", "exact double backward", photos, 1.0);
    add("R1 and its gradient, logits times 1e4",
        "R1 is taken of the logit, which does not saturate", photos, 1e4);
    add("R1 and its gradient of a zero image",
        "leaky ReLU has a slope at 0, the deviation 1e-8 under its root", nothing, 1.0);
    add("R1 and its gradient of two equal images", "the same", Tensor::full({2, 64, 64, 3}, 0.3),
        1.0);
    const std::vector<Tensor> logits = scalars({-1e4, -20.0, 0.0, 20.0, 1e4});
    rows.push_back(
        row("losses of saturated logits, two derivatives",
            "softplus of the logit, no logarithm of a probability", 1e-6, 1e-6, logits,
            each([](const Variable& x) { return generator_loss(x) + fake_loss(x) * 0.25; }), 2));
    return rows;
}

/// LPIPS with fixed random weights between two images of one colour each, or of noise, and the
/// gradient in the first.
StabilityCase perceptual(const std::string& name, const std::string& behaviour, const Tensor& a,
                         const Tensor& b) {
    return {.name = name,
            .behaviour = behaviour,
            .value_bound = 1e-5,
            .gradient_bound = 1e-3,
            .run = [=](DType dtype) {
                Lpips lpips({.network = "squeezenet1_1", .trunk = "random", .heads = "random"}, "");
                lpips.parameters().convert(dtype);
                const Lpips::Features target = lpips.features(b.to(dtype));
                return differentiate(dtype, {a}, [&](const std::vector<Variable>& x) {
                    return std::vector<Variable>{lpips.distance(lpips.features(x[0]), target)};
                });
            }};
}

/// The fused distance of features whose pixels have this norm, from targets of norm 1, and its
/// gradient.
StabilityCase fused_distance(const std::string& name, const std::string& behaviour, double norm) {
    constexpr std::int64_t channels = 64;
    const Shape shape{1, 3, 3, channels};
    const Tensor direction = Rng(15).uniform(shape, -1.0, 1.0);
    const Tensor x = (unit_channels(Variable(direction), 0.0) * norm).value();
    const Tensor target = unit_channels(Variable(Rng(16).uniform(shape, -1.0, 1.0)), 0.0).value();
    const Tensor weight = Rng(17).uniform({channels}, 0.0, 1.0);
    return row(name, behaviour, 1e-5, 1e-5, {x}, each([=](const Variable& features) {
                   return feature_distance(features, target.to(features.dtype()),
                                           weight.to(features.dtype()));
               }));
}

std::vector<StabilityCase> fused_distance_cases() {
    const std::string wide = "the norm in float64 where its square leaves float32's range";
    std::vector<StabilityCase> rows;
    for (const auto& [name, norm] : {std::pair{"1e-30", 1e-30},
                                     {"1e-20", 1e-20},
                                     {"1e-10", 1e-10},
                                     {"1", 1.0},
                                     {"1e20", 1e20},
                                     {"1e30", 1e30}})
        rows.push_back(
            fused_distance(std::string("LPIPS, fused, features of norm ") + name, wide, norm));
    rows.push_back(fused_distance("LPIPS, fused, features of norm 0",
                                  "where all channels are 0 the direction is 0", 0.0));
    return rows;
}

std::vector<StabilityCase> perceptual_cases() {
    const Shape shape{1, 32, 32, 3};
    const Tensor noise = Rng(10).uniform(shape, -1.0, 1.0), black = Tensor::full(shape, -1.0),
                 white = Tensor::full(shape, 1.0);
    return {perceptual("LPIPS of identical images",
                       "distance 0, gradient 0: no root is taken of it", noise, noise),
            perceptual("LPIPS of two black images", "where all channels are 0 the direction is 0",
                       black, black),
            perceptual("LPIPS of black against white", "the same", black, white),
            perceptual("LPIPS of white against noise", "the same", white, noise)};
}

StabilityCase compared(const std::string& name, const std::string& behaviour,
                       double (*metric)(const Tensor&, const Tensor&), const Tensor& a,
                       const Tensor& b) {
    return {.name = name, .behaviour = behaviour, .value_bound = 1e-12, .run = [=](DType dtype) {
                return StabilityResult{
                    .values = {Tensor::scalar(metric(a.to(dtype), b.to(dtype)), DType::float64)}};
            }};
}

std::vector<StabilityCase> metric_cases() {
    const auto ssim = [](const Tensor& a, const Tensor& b) { return structural_similarity(a, b); };
    const Shape shape{16, 16, 3};
    const Tensor noise = Rng(11).uniform(shape, 0.0, 1.0), grey = Tensor::full(shape, 0.5),
                 black = Tensor::zeros(shape), white = Tensor::full(shape, 1.0);
    const std::string constants =
        "computed in float64 from both types; the constants keep the quotient defined";
    StabilityCase identical = compared("PSNR of identical images",
                                       "infinite by definition; tools print \"equal\", JSON null",
                                       peak_signal_to_noise_ratio, noise, noise);
    identical.infinite = true;
    return {
        std::move(identical),
        compared("PSNR of black against white", "0 dB", peak_signal_to_noise_ratio, black, white),
        compared("SSIM of a constant image with itself", constants, ssim, grey, grey),
        compared("SSIM of two black images", constants, ssim, black, black),
        compared("SSIM of black against white", constants, ssim, black, white),
        compared("SSIM of a constant against noise", constants, ssim, grey, noise)};
}

std::vector<StabilityCase> mask_cases() {
    const Shape shape{2, 4, 4, 1};
    Tensor half = Tensor::zeros(shape);
    std::ranges::fill(half.mutable_values<float>().subspan(16, 5), 1.0F);
    const Tensor logit = Rng(12).normal(shape, 0.0, 4.0),
                 image = Rng(13).uniform({2, 4, 4, 3}, -1.0, 1.0);
    Tensor transmittance = Rng(14).uniform(shape, 0.0, 1.0);
    transmittance.mutable_values<float>()[0] = 0.0F;
    transmittance.mutable_values<float>()[1] = 1.0F;
    std::vector<StabilityCase> rows;
    for (const auto& named : {std::pair{"an empty mask", Tensor::zeros(shape)},
                              std::pair{"a full mask", Tensor::full(shape, 1.0)},
                              std::pair{"a mask that is empty for one of two faces", half}}) {
        // Clang 14 captures no structured bindings.
        const std::string name = named.first;
        const Tensor& mask = named.second;
        const auto loss = [&](const std::string& what, const std::string& behaviour,
                              const Tensor& input, auto function) {
            rows.push_back(row(what + ", " + name, behaviour, 1e-6, 1e-6, {input},
                               each([=, mask = mask](const Variable& x) {
                                   return function(x, mask.to(x.dtype()));
                               })));
        };
        loss("mean colour under a mask", "0 where there is no pixel: its area counts as 1", image,
             masked_mean);
        loss("mask loss", "mean over the image, not over the mask", logit,
             [](auto& x, const Tensor& inside) { return mask_loss(x, inside); });
        loss("opacity loss", "1e-3 in the logarithms bounds value and gradient", transmittance,
             [](auto& x, const Tensor& inside) { return opacity_loss(x, inside); });
    }
    return rows;
}

}  // namespace

std::vector<StabilityCase> loss_cases() {
    return joined({adversarial_cases(), perceptual_cases(), fused_distance_cases(), metric_cases(),
                   mask_cases()});
}

}  // namespace stymo::stability
