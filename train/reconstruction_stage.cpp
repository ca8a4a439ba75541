#include "train/reconstruction_stage.h"

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/losses.h"
#include "train/loss_sum.h"
#include "train/memory_estimate.h"

namespace stymo {

void LossTerms::accumulate(const LossTerms& other, double part) {
    total += part * other.total;
    reconstruction += part * other.reconstruction;
    photometric += part * other.photometric;
    perceptual += part * other.perceptual;
    adversarial += part * other.adversarial;
    code += part * other.code;
    mask += part * other.mask;
    opacity += part * other.opacity;
    depth_variance += part * other.depth_variance;
    code_norm += part * other.code_norm;
}

namespace {

/// The mask where the rays are: one value for each.
Tensor mask_of_rays(const TrainingBatch& batch, const Decoded& decoded) {
    const std::int64_t rays = decoded.weights.transmittance.shape(1);
    if (rays == batch.mask_32.shape(1) * batch.mask_32.shape(2)) return batch.mask_32;
    const int side = static_cast<int>(decoded.images.back().shape(1));
    return resize_box(batch.mask, side, side).value();
}

}  // namespace

void add_common_terms(Variable& total, LossTerms& report, const ReconstructionLoss::Terms& terms, const Decoded& decoded,
                      const TrainingBatch& batch, bool with_mask, const LossConfig& weights) {
    total = total + terms.total;
    report.reconstruction = terms.total.value().item();
    report.photometric = terms.photometric.value().item();
    if (terms.perceptual.defined()) report.perceptual = terms.perceptual.value().item();
    add_term(total, report.mask, with_mask ? weights.mask_weight : 0.0,
             [&] { return mask_loss(decoded.mask_logit, batch.mask); });
    add_term(total, report.opacity, weights.opacity_weight,
             [&] { return opacity_loss(decoded.weights.transmittance, mask_of_rays(batch, decoded)); });
    add_term(total, report.depth_variance, weights.depth_variance_weight,
             [&] { return depth_variance(decoded.weights.weights, decoded.samples.depths); });
}

LossAndGradients reconstruction_gradients(const Model& model, const ReconstructionLoss& reconstruction,
                                          const TrainingBatch& batch, const TrainConfig& config,
                                          const std::vector<Parameter>& parameters, bool mask_loss, Rng& jitter,
                                          const CodeOffsets* offsets) {
    const LossConfig& weights = config.loss;
    const Codes codes = face_codes(model, batch, offsets);
    const bool with_mask = mask_loss && weights.mask_weight > 0.0;
    const std::int64_t samples_per_ray = config.stage1.samples_per_ray;
    const std::int64_t resolution = stage1_resolution(config);
    const Recomputation recomputation = choose_recomputation(
        config, {.stage = 1, .resolution = resolution, .micro_batch = codes.batch(), .samples_per_ray = samples_per_ray});
    const Decoded decoded = model.decoder()(codes, batch.cameras,
                                            {.samples_per_ray = samples_per_ray,
                                             .resolution = resolution,
                                             .mask = with_mask,
                                             .keep_field = !recomputation.field,
                                             .recompute_blocks = recomputation.blocks,
                                             .jitter = &jitter});

    LossAndGradients result;
    LossTerms& report = result.losses;
    Variable total = Tensor::zeros({}, decoded.images.back().dtype());
    add_common_terms(total, report, reconstruction(decoded.images, reconstruction.target(batch.targets, resolution)), decoded,
                     batch, with_mask, weights);
    add_term(total, report.code, batch.has_codes() ? 1.0 : 0.0,
             [&] { return code_loss(codes, batch.codes, std::span<const double, 4>(weights.code_weights), batch.code_present); });
    add_term(total, report.code_norm, weights.code_norm_weight,
             [&] { return squared_length(codes) / static_cast<double>(codes.batch() * code_size); });
    report.total = total.value().item();
    result.gradients = grad(total, variables_of(parameters));
    return result;
}

}  // namespace stymo
