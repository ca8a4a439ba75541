#include <catch2/catch.hpp>
#include <cmath>

#include "nn/optim/adam.h"
#include "train/agreement_case.h"
#include "train/step_gradients.h"

using namespace stymo;
using namespace stymo::test;

// The numbers are PyTorch's, in float64: tests/golden/make_agreement_vectors.py.
namespace {

/// Updates of the discriminator, of R1 and of the decoder, in this order.
void second_stage_agrees(const AgreementCase& agreement, double fade, bool check_gradients,
                         DType dtype) {
    const TrainConfig config = agreement.config();
    const AdversarialStageConfig& stage = config.stage2;
    Model model = agreement.model(dtype);
    const ReconstructionLoss reconstruction = agreement.reconstruction(dtype);
    const FaceBatch batch = agreement.training_batch(dtype);
    const TrainingPosition position{.phase = {.stage = 2,
                                              .resolution = agreement.decoder.resolution,
                                              .samples_per_ray = agreement.samples},
                                    .fade = fade,
                                    .mask_loss = true};
    Rng unused(1);
    ParameterStore discriminator_parameters;
    const Discriminator discriminator(config.discriminator, agreement.decoder.resolution,
                                      discriminator_parameters, "discriminator", unused);
    set_golden_parameters(discriminator_parameters, dtype, agreement.seed);
    Rng jitter = agreement.jitter();
    const GeneratorInputs inputs{model, reconstruction, config, nullptr, &discriminator};

    model.parameters().set_trainable("", false);
    const std::vector<Parameter> updated = discriminator_parameters.trainable();
    const double lazy =
        static_cast<double>(stage.r1_interval) / static_cast<double>(stage.r1_interval + 1);
    Adam discriminator_adam(
        {std::pow(stage.beta1, lazy), std::pow(stage.beta2, lazy), stage.epsilon});
    const LossAndGradients of_loss =
        discriminator_gradients(inputs, position, batch, updated, jitter);
    discriminator_adam.step(updated, of_loss.gradients, stage.discriminator_learning_rate * lazy);
    constexpr double gamma = 10.0;
    const LossAndGradients r1 = r1_gradients(
        discriminator, position, batch, gamma * static_cast<double>(stage.r1_interval), updated);
    discriminator_adam.step(updated, r1.gradients, stage.discriminator_learning_rate * lazy);
    agreement.check("discriminator_loss",
                    {{"loss", Tensor::scalar(of_loss.losses["discriminator"], dtype)},
                     {"real_logit", Tensor::scalar(of_loss.losses["real_logit"], dtype)},
                     {"fake_logit", Tensor::scalar(of_loss.losses["fake_logit"], dtype)},
                     {"r1", Tensor::scalar(r1.losses["r1"], dtype)}});

    discriminator_parameters.set_trainable("", false);
    model.parameters().set_trainable("decoder.", true);
    const std::vector<Parameter> parameters = model.parameters().trainable();
    const LossAndGradients result =
        generator_gradients(inputs, position, batch, parameters, jitter);
    Tensors losses = common_terms(result.losses, dtype);
    losses["adversarial"] = Tensor::scalar(result.losses["adversarial"], dtype);
    agreement.check("generator_loss", losses);
    Adam adam({stage.beta1, stage.beta2, stage.epsilon});
    for (const bool mapping : {false, true}) {
        std::vector<Parameter> group;
        std::vector<Variable> gradients;
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            if (parameters[i].name().starts_with("decoder.mapping.") != mapping) continue;
            group.push_back(parameters[i]);
            gradients.push_back(result.gradients[i]);
        }
        adam.step(group, gradients, stage.learning_rate * (mapping ? stage.mapping_factor : 1.0));
    }
    Tensors stepped = values_of(updated);
    stepped.merge(values_of(parameters));
    agreement.check("stepped", stepped);
    if (!check_gradients) return;
    agreement.check("discriminator_gradient", gradients_of(updated, of_loss.gradients));
    agreement.check("r1_gradient", gradients_of(updated, r1.gradients));
    agreement.check("generator_gradient", gradients_of(parameters, result.gradients),
                    agreement.gradient_bound);
}

}  // namespace

TEST_CASE("a second-stage step of a tiny model agrees with PyTorch", "[agreement]") {
    AgreementCase agreement =
        small_agreement("stage2", 3, {64, 8, 2, 8, 3, {6}, 2, 2, 32}, "squeezenet1_1");
    agreement.batch = 4;
    for (const DType dtype : {DType::float64, DType::float32})
        second_stage_agrees(agreement, 1.0, false, dtype);
}

TEST_CASE(
    "a second-stage step of a tiny model agrees with PyTorch while the discriminator's block of "
    "128 fades in",
    "[agreement]") {
    AgreementCase agreement =
        small_agreement("stage2_fading", 271, {128, 8, 2, 8, 3, {6, 5}, 2, 2, 32});
    agreement.batch = 4;
    for (const DType dtype : {DType::float64, DType::float32})
        second_stage_agrees(agreement, 0.3, true, dtype);
}

TEST_CASE("a second-stage step at the paper's width agrees with PyTorch", "[agreement][slow]") {
    if (const auto folder = golden_folder())
        for (const DType dtype : {DType::float64, DType::float32})
            second_stage_agrees(full_agreement("stage2", *folder, dtype), 1.0, false, dtype);
}

TEST_CASE(
    "a second-stage step at the paper's width agrees with PyTorch while the discriminator's block "
    "of 128 fades in",
    "[agreement][slow]") {
    const auto folder = golden_folder();
    if (!folder) return;
    for (const DType dtype : {DType::float64, DType::float32}) {
        AgreementCase agreement = full_agreement("stage2_fading", *folder, dtype);
        agreement.decoder = decoder_config({128, 256, 8, 256, 10, {128, 64}, 16, 4, 32});
        agreement.batch = 4;
        agreement.perceptual.clear();
        second_stage_agrees(agreement, 0.3, true, dtype);
    }
}
