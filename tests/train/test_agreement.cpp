#include <catch2/catch.hpp>

#include "nn/optim/adam.h"
#include "train/agreement_case.h"

using namespace stymo;
using namespace stymo::test;

// The numbers are PyTorch's, in float64: tests/golden/make_agreement_vectors.py.
namespace {

void first_stage_agrees(const AgreementCase& agreement, DType dtype) {
    const TrainConfig config = agreement.config();
    const Model model = agreement.model(dtype);
    const std::vector<Parameter> parameters = model.parameters().trainable();
    Rng jitter = agreement.jitter();
    const ReconstructionLoss reconstruction = agreement.reconstruction(dtype);
    TrainingPosition position = TrainingSchedule(config).position(0);
    position.mask_loss = true;
    const LossAndGradients result =
        generator_gradients({model, reconstruction, config}, position,
                            agreement.training_batch(dtype), parameters, jitter);
    Tensors losses = common_terms(result.losses, dtype);
    losses["code"] = Tensor::scalar(result.losses["code"], dtype);
    losses["code_norm"] = Tensor::scalar(result.losses["code_norm"], dtype);
    agreement.check("loss", losses);
    agreement.check("gradient", gradients_of(parameters, result.gradients),
                    agreement.gradient_bound);
    Adam({config.optimizer.beta1, config.optimizer.beta2, config.optimizer.epsilon})
        .step(parameters, result.gradients, config.optimizer.learning_rate);
    agreement.check("stepped", values_of(parameters));
}

}  // namespace

TEST_CASE("a tiny decoder with its rays, images and mask, and all its gradients agree with PyTorch",
          "[agreement]") {
    const AgreementCase agreement =
        small_agreement("decoder", 9, {16, 8, 4, 6, 2, {5, 4}, 3, 2, 4});
    for (const DType dtype : {DType::float64, DType::float32}) decoder_agrees(agreement, dtype);
}

TEST_CASE(
    "decoders with concatenated codes, with render blocks or a ray for each pixel, agree with "
    "PyTorch",
    "[agreement]") {
    for (const auto& [name, render] :
         {std::pair{"head_nerf", "blocks"}, std::pair{"pixel_nerf", "none"}}) {
        INFO(name);
        const AgreementCase agreement = baseline_agreement(name, render);
        for (const DType dtype : {DType::float64, DType::float32}) decoder_agrees(agreement, dtype);
    }
}

TEST_CASE("a first-stage step of a tiny model agrees with PyTorch", "[agreement]") {
    const AgreementCase agreement =
        small_agreement("stage1", 3, {64, 8, 2, 8, 3, {6, 5}, 2, 2, 16}, "squeezenet1_1");
    for (const DType dtype : {DType::float64, DType::float32}) first_stage_agrees(agreement, dtype);
}

TEST_CASE("the paper's decoder at 64 pixels and all its gradients agree with PyTorch",
          "[agreement][slow]") {
    if (const auto folder = golden_folder())
        for (const DType dtype : {DType::float64, DType::float32})
            decoder_agrees(full_agreement("decoder", *folder, dtype), dtype);
}

TEST_CASE("a first-stage step at the paper's width agrees with PyTorch", "[agreement][slow]") {
    if (const auto folder = golden_folder())
        for (const DType dtype : {DType::float64, DType::float32})
            first_stage_agrees(full_agreement("stage1", *folder, dtype), dtype);
}
