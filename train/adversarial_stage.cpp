#include "train/adversarial_stage.h"

#include <algorithm>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/adversarial.h"
#include "nn/losses.h"
#include "train/loss_sum.h"

namespace stymo {

void DiscriminatorTerms::accumulate(const DiscriminatorTerms& other, double part) {
    loss += part * other.loss;
    real_logit += part * other.real_logit;
    fake_logit += part * other.fake_logit;
    r1 += part * other.r1;
}

namespace {

std::vector<Variable> leaves_of(const std::vector<Parameter>& parameters) {
    std::vector<Variable> leaves;
    for (const Parameter& parameter : parameters) leaves.push_back(parameter.variable());
    return leaves;
}

const Tensor& photos(const TrainingBatch& batch, const AdversarialPhase& phase) {
    const auto found = std::ranges::find_if(batch.targets, [&](const Tensor& t) { return t.shape(1) == phase.resolution; });
    if (found == batch.targets.end())
        fail<ShapeError>("the batch has no pictures of ", phase.resolution, " pixels for this phase of the second stage");
    return *found;
}

Codes constant(const Codes& codes) {
    Codes result;
    std::ranges::transform(codes.groups, result.groups.begin(), &Variable::detach);
    return result;
}

/// Pictures of the batch's faces as the discriminator sees them, one face at a time: none needs the memory of more.
Tensor fakes(const Model& model, const TrainingBatch& batch, const AdversarialPhase& phase, Rng& jitter) {
    const Codes codes = constant(model.encoder()(Variable(batch.input)));
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
    const Variable leaf = Variable::leaf(images.value());
    const Variable loss = generator_loss(discriminator(faded_image(leaf, fade), fade));
    const Variable gradient = grad(loss, leaf);
    return sum((images - images.detach()) * gradient) + loss.value().item();
}

}  // namespace

DiscriminatorGradients discriminator_gradients(const Model& model, const Discriminator& discriminator, const TrainingBatch& batch,
                                               const AdversarialPhase& phase, const std::vector<Parameter>& parameters,
                                               Rng& jitter) {
    const Tensor real_images = faded_image(photos(batch, phase), phase.fade).value();
    const Tensor fake_images = fakes(model, batch, phase, jitter);
    const std::vector<Variable> leaves = leaves_of(parameters);
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
    result.gradients = grad(penalty * weight, leaves_of(parameters));
    return result;
}

LossAndGradients generator_gradients(const Model& model, const Discriminator* discriminator,
                                     const ReconstructionLoss& reconstruction, const TrainingBatch& batch,
                                     const AdversarialPhase& phase, const TrainConfig& config,
                                     const std::vector<Parameter>& parameters, bool mask_loss, Rng& jitter) {
    const LossConfig& weights = config.loss;
    // The branch sums up the features of every block, so it is trained where all of them are there.
    const bool with_mask = mask_loss && weights.mask_weight > 0.0 && phase.resolution == model.decoder().config().resolution;
    const Codes codes = constant(model.encoder()(Variable(batch.input)));
    const Decoded decoded = model.decoder()(
        codes, batch.cameras,
        {.samples_per_ray = phase.samples_per_ray, .resolution = phase.resolution, .mask = with_mask, .jitter = &jitter});

    LossAndGradients result;
    LossTerms& report = result.losses;
    Variable total = Tensor::zeros({}, decoded.images.back().dtype());
    add_term(total, report.adversarial, weights.adversarial_weight,
             [&] { return adversarial_loss(*discriminator, decoded.images.back(), phase.fade); });
    const ReconstructionLoss::Terms terms =
        reconstruction(decoded.images, reconstruction.target(batch.targets, phase.resolution));
    total = total + terms.total;
    report.reconstruction = terms.total.value().item();
    report.photometric = terms.photometric.value().item();
    if (terms.perceptual.defined()) report.perceptual = terms.perceptual.value().item();
    add_term(total, report.mask, with_mask ? weights.mask_weight : 0.0,
             [&] { return stymo::mask_loss(decoded.mask_logit, batch.mask); });
    add_term(total, report.opacity, weights.opacity_weight,
             [&] { return opacity_loss(decoded.weights.transmittance, batch.mask_32); });
    add_term(total, report.depth_variance, weights.depth_variance_weight,
             [&] { return depth_variance(decoded.weights.weights, decoded.samples.depths); });
    report.total = total.value().item();
    result.gradients = grad(total, leaves_of(parameters));
    return result;
}

}  // namespace stymo
