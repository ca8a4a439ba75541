#include "train/step_gradients.h"

#include <algorithm>
#include <utility>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/elementwise.h"
#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "nn/losses.h"
#include "train/loss_terms.h"

namespace stymo {

namespace {

/// Share of the elements that are at least `threshold`.
double share_above(const Tensor& x, double threshold) {
    return dispatch(x.dtype(), [&]<class T>(T) {
        const auto above = std::ranges::count_if(
            x.values<T>(), [least = static_cast<T>(threshold)](T value) { return value >= least; });
        return static_cast<double>(above) / static_cast<double>(x.size());
    });
}

}  // namespace

std::vector<Variable> gradients_for(const GradientSink& sink, const Variable& y,
                                    std::span<const Variable> xs) {
    if (!sink) return grad(y, xs);
    grad_in_turn(y, xs, sink);
    return {};
}

LossAndGradients generator_gradients(const GeneratorInputs& inputs,
                                     const TrainingPosition& position, const FaceBatch& batch,
                                     const std::vector<Parameter>& parameters, Rng& jitter,
                                     const GradientSink& sink) {
    const TrainingPhase& phase = position.phase;
    Codes codes =
        inputs.codes != nullptr ? *inputs.codes : face_codes(inputs.model, batch, inputs.offsets);
    if (phase.stage == 2) codes = detached(codes);
    const Decoder& decoder = inputs.model.decoder();
    const Recomputation& recomputation = phase.execution.recomputation;
    // The mask branch sums the features of all blocks, so it is trained only if all blocks are
    // used.
    const bool mask = position.mask_loss && inputs.config.loss.mask_weight > 0.0 &&
                      phase.resolution == decoder.ladder().largest();
    const bool learn_poses = inputs.offsets != nullptr && learns_poses(inputs.config, position);
    const Decoded decoded =
        decoder(codes, face_cameras(batch, inputs.offsets),
                {.samples_per_ray = phase.samples_per_ray,
                 .resolution = phase.resolution,
                 .mask = mask,
                 .gradient_tolerance = inputs.config.optimizer.sample_tolerance,
                 .keep_field = !recomputation.field,
                 .recompute_blocks = recomputation.blocks,
                 .orbits = learn_poses ? inputs.offsets->orbits(batch) : Variable(),
                 .jitter = &jitter});

    LossAndGradients result;
    result.losses[significant_share] =
        share_above(decoded.weights.weights.value(), inputs.config.optimizer.sample_tolerance);
    const LossInputs terms{inputs.model,          inputs.config,  position, batch,
                           inputs.reconstruction, codes,          decoded,  inputs.discriminator,
                           inputs.augmentations,  inputs.identity};
    Variable total = Tensor::zeros({}, decoded.images.back().dtype());
    for (const LossTerm& term : loss_terms()) {
        const double weight = term.weight(terms);
        if (weight == 0.0) continue;
        const Variable value = term.value(terms, result.losses);
        work::count_named("loss_terms", term.name, 1);
        result.losses[term.name] = value.value().item();
        total = total + (weight == 1.0 ? value : value * weight);
    }
    result.losses.total = total.value().item();
    result.gradients = gradients_for(sink, total, variables_of(parameters));
    return result;
}

namespace {

/// The photos as the discriminator sees them.
Tensor real_images(const FaceBatch& batch, const TrainingPosition& position) {
    const auto found = std::ranges::find(batch.targets, position.phase.resolution,
                                         [](const Tensor& images) { return images.shape(1); });
    if (found == batch.targets.end())
        fail<ShapeError>("the batch has no images of ", position.phase.resolution,
                         " pixels for this phase of the second stage");
    return faded_image(*found, position.fade).value();
}

/// Rendered images of the batch's faces for the discriminator. One face at a time saves memory.
Tensor fake_images(const GeneratorInputs& inputs, const FaceBatch& batch,
                   const TrainingPosition& position, Rng& jitter) {
    const Codes codes = detached(
        inputs.codes != nullptr ? *inputs.codes : face_codes(inputs.model, batch, inputs.offsets));
    const std::vector<Camera> cameras = face_cameras(batch, inputs.offsets);
    std::vector<Variable> images;
    for (std::int64_t i = 0; i < codes.batch(); ++i) {
        Codes face;
        std::ranges::transform(codes.groups, face.groups.begin(),
                               [i](const Variable& g) { return slice(g, 0, i, i + 1); });
        const Decoded decoded =
            inputs.model.decoder()(face, {cameras[static_cast<std::size_t>(i)]},
                                   {.samples_per_ray = position.phase.samples_per_ray,
                                    .resolution = position.phase.resolution,
                                    .jitter = &jitter});
        images.push_back(decoded.images.back().detach());
    }
    return faded_image(seen_by_discriminator(concat(images, 0), batch), position.fade).value();
}

double mean_sign(const Tensor& logits) {
    double sum = 0.0;
    for (const double logit : logits.to_vector())
        sum += static_cast<double>(logit > 0.0) - static_cast<double>(logit < 0.0);
    return sum / static_cast<double>(logits.size());
}

}  // namespace

LossAndGradients discriminator_gradients(const GeneratorInputs& inputs,
                                         const TrainingPosition& position, const FaceBatch& batch,
                                         const std::vector<Parameter>& parameters, Rng& jitter,
                                         const GradientSink& sink) {
    const std::span<const ImageAugmentation> augmentations = inputs.augmentations;
    const std::size_t count = augmentations.size() / 2;
    const Tensor real = augmented(real_images(batch, position), augmentations.first(count)).value();
    const Tensor fake =
        augmented(fake_images(inputs, batch, position, jitter), augmentations.subspan(count))
            .value();
    const std::vector<Variable> leaves = variables_of(parameters);
    LossAndGradients result;
    // The graph of one term is released before the other is computed.
    const auto classify = [&](const Tensor& images, Variable (*loss_of)(const Variable&),
                              std::string_view logit_name) {
        const Variable logits = (*inputs.discriminator)(images, position.fade);
        if (loss_of == real_loss) result.losses["real_sign"] = mean_sign(logits.value());
        const Variable loss = loss_of(logits);
        result.losses.total += loss.value().item();
        result.losses[logit_name] = mean(logits).value().item();
        return loss;
    };
    result.gradients = grad(classify(real, real_loss, "real_logit"), leaves);
    const GradientSink add_fake = [&](std::size_t i, const Variable& of_fake) {
        Variable sum = std::exchange(result.gradients[i], {}) + of_fake;
        if (sink)
            sink(i, std::move(sum));
        else
            result.gradients[i] = std::move(sum);
    };
    grad_in_turn(classify(fake, fake_loss, "fake_logit"), leaves, add_fake);
    result.losses["discriminator"] = result.losses.total;
    if (sink) result.gradients.clear();
    return result;
}

LossAndGradients r1_gradients(const Discriminator& discriminator, const TrainingPosition& position,
                              const FaceBatch& batch, double weight,
                              const std::vector<Parameter>& parameters,
                              std::span<const ImageAugmentation> augmentations,
                              const GradientSink& sink) {
    const Variable penalty = r1_penalty(
        [&](const Variable& images) {
            return discriminator(augmented(images, augmentations), position.fade);
        },
        real_images(batch, position));
    LossAndGradients result;
    result.losses.total = penalty.value().item();
    result.losses["r1"] = result.losses.total;
    result.gradients = gradients_for(sink, penalty * weight, variables_of(parameters));
    return result;
}

}  // namespace stymo
