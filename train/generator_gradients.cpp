#include "train/generator_gradients.h"

#include <algorithm>

#include "core/ops/elementwise.h"
#include "core/work_counts.h"

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

}  // namespace stymo
