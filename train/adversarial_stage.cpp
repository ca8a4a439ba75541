#include "train/adversarial_stage.h"

#include <algorithm>

#include "core/autograd/grad.h"
#include "core/autograd/recompute.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/adversarial.h"
#include "train/loss_sum.h"
#include "train/memory_estimate.h"

namespace stymo {

void DiscriminatorTerms::accumulate(const DiscriminatorTerms& other, double part) {
    loss += part * other.loss;
    real_logit += part * other.real_logit;
    fake_logit += part * other.fake_logit;
    r1 += part * other.r1;
}

namespace {

const Tensor& photos(const TrainingBatch& batch, const AdversarialPhase& phase) {
    const auto found = std::ranges::find_if(batch.targets, [&](const Tensor& t) { return t.shape(1) == phase.resolution; });
    if (found == batch.targets.end())
        fail<ShapeError>("the batch has no pictures of ", phase.resolution, " pixels for this phase of the second stage");
    return *found;
}

/// Pictures of the batch's faces as the discriminator sees them, one face at a time: none needs the memory of more.
Tensor fakes(const Model& model, const TrainingBatch& batch, const AdversarialPhase& phase, Rng& jitter,
             const CodeOffsets* offsets) {
    const Codes codes = detached(face_codes(model, batch, offsets));
    std::vector<Variable> pictures;
    for (std::int64_t i = 0; i < codes.batch(); ++i) {
        Codes face;
        std::ranges::transform(codes.groups, face.groups.begin(), [i](const Variable& g) { return slice(g, 0, i, i + 1); });
        const Decoded decoded =
            model.decoder()(face, {batch.cameras[static_cast<std::size_t>(i)]},
                            {.samples_per_ray = phase.samples_per_ray, .resolution = phase.resolution, .jitter = &jitter});
        pictures.push_back(decoded.images.back().detach());
    }
    return faded_image(concat(pictures, 0), phase.fade).value();
}

struct Judged {
    double loss = 0.0;
    double logit = 0.0;  ///< mean
    std::vector<Variable> gradients;
};

Judged judged(const Discriminator& discriminator, const Tensor& images, double fade, Variable (*loss_of)(const Variable&),
              const std::vector<Variable>& leaves) {
    const Variable logits = discriminator(images, fade);
    const Variable loss = loss_of(logits);
    return {loss.value().item(), mean(logits).value().item(), grad(loss, leaves)};
}

/// The adversarial loss of `images` with its gradient already taken, so that the discriminator's graph is gone before the
/// perceptual network's is made.
Variable adversarial_loss(const Discriminator& discriminator, const Variable& images, double fade) {
    return differentiate_at_once([&](const Variable& x) { return generator_loss(discriminator(faded_image(x, fade), fade)); },
                                 images);
}

}  // namespace

DiscriminatorGradients discriminator_gradients(const Model& model, const Discriminator& discriminator, const TrainingBatch& batch,
                                               const AdversarialPhase& phase, const std::vector<Parameter>& parameters,
                                               Rng& jitter, const CodeOffsets* offsets) {
    const Tensor real_images = faded_image(photos(batch, phase), phase.fade).value();
    const Tensor fake_images = fakes(model, batch, phase, jitter, offsets);
    const std::vector<Variable> leaves = variables_of(parameters);
    const Judged real = judged(discriminator, real_images, phase.fade, real_loss, leaves);
    const Judged fake = judged(discriminator, fake_images, phase.fade, fake_loss, leaves);

    DiscriminatorGradients result;
    result.losses = {.loss = real.loss + fake.loss, .real_logit = real.logit, .fake_logit = fake.logit};
    for (std::size_t i = 0; i < leaves.size(); ++i) result.gradients.push_back(real.gradients[i] + fake.gradients[i]);
    return result;
}

DiscriminatorGradients r1_gradients(const Discriminator& discriminator, const TrainingBatch& batch, const AdversarialPhase& phase,
                                    double weight, const std::vector<Parameter>& parameters) {
    const Tensor real_images = faded_image(photos(batch, phase), phase.fade).value();
    const Variable penalty = r1_penalty([&](const Variable& images) { return discriminator(images, phase.fade); }, real_images);
    DiscriminatorGradients result;
    result.losses.r1 = penalty.value().item();
    result.gradients = grad(penalty * weight, variables_of(parameters));
    return result;
}

LossAndGradients generator_gradients(const Model& model, const Discriminator* discriminator,
                                     const ReconstructionLoss& reconstruction, const TrainingBatch& batch,
                                     const AdversarialPhase& phase, const TrainConfig& config,
                                     const std::vector<Parameter>& parameters, bool mask_loss, Rng& jitter,
                                     const CodeOffsets* offsets) {
    const LossConfig& weights = config.loss;
    // The branch sums up the features of every block, so it is trained where all of them are there.
    const bool with_mask = mask_loss && weights.mask_weight > 0.0 && phase.resolution == model.decoder().config().resolution;
    const Codes codes = detached(face_codes(model, batch, offsets));
    const Recomputation recomputation = choose_recomputation(
        config,
        {.stage = 2, .resolution = phase.resolution, .micro_batch = codes.batch(), .samples_per_ray = phase.samples_per_ray});
    const Decoded decoded = model.decoder()(codes, batch.cameras,
                                            {.samples_per_ray = phase.samples_per_ray,
                                             .resolution = phase.resolution,
                                             .mask = with_mask,
                                             .keep_field = !recomputation.field,
                                             .recompute_blocks = recomputation.blocks,
                                             .jitter = &jitter});

    LossAndGradients result;
    LossTerms& report = result.losses;
    Variable total = Tensor::zeros({}, decoded.images.back().dtype());
    add_term(total, report.adversarial, weights.adversarial_weight,
             [&] { return adversarial_loss(*discriminator, decoded.images.back(), phase.fade); });
    add_common_terms(total, report, reconstruction(decoded.images, reconstruction.target(batch.targets, phase.resolution)),
                     decoded, batch, with_mask, weights);
    report.total = total.value().item();
    result.gradients = grad(total, variables_of(parameters));
    return result;
}

}  // namespace stymo
