#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/optim/adam.h"
#include "train/agreement_case.h"

using namespace stymo;
using namespace stymo::test;

// The numbers are PyTorch's, in float64: tests/golden/make_agreement_vectors.py.
namespace {

void decoder_agrees(const AgreementCase& agreement, DType dtype) {
    Rng unused(1);
    ParameterStore store;
    const Decoder decoder(agreement.decoder, store, "decoder", unused);
    set_golden_parameters(store, dtype, agreement.seed);
    Codes z;
    const std::array<Tensor, 4> codes = agreement.codes("z", dtype);
    for (std::size_t i = 0; i < codes.size(); ++i) z.groups[i] = Variable::leaf(codes[i]);
    const Decoded decoded = decoder(z, agreement.cameras(), {.samples_per_ray = agreement.samples, .mask = true});

    std::map<std::string, Variable> outputs{{"feature_map", decoded.feature_map}, {"mask_logit", decoded.mask_logit}};
    for (std::size_t i = 0; i < decoded.images.size(); ++i) outputs["image" + std::to_string(i)] = decoded.images[i];
    Tensors values;
    Variable loss = Tensor::zeros({}, dtype);
    for (const auto& [name, output] : outputs) {
        values[name] = output.value();
        loss = loss + mean(square(output));
    }
    agreement.check("output", values);

    std::vector<Variable> leaves = variables_of(store.all());
    leaves.insert(leaves.end(), z.groups.begin(), z.groups.end());
    const std::vector<Variable> gradients = grad(loss, leaves);
    Tensors named = gradients_of(store.all(), gradients);
    for (std::size_t i = 0; i < z.groups.size(); ++i)
        named[std::string("z.") + code_names[i]] = gradients[store.all().size() + i].value();
    agreement.check("gradient", named);
}

void first_stage_agrees(const AgreementCase& agreement, DType dtype) {
    const TrainConfig config = agreement.config();
    const Model model = agreement.model(dtype);
    const std::vector<Parameter> parameters = model.parameters().trainable();
    Rng jitter = agreement.jitter();
    const LossAndGradients result = reconstruction_gradients(model, agreement.reconstruction(dtype),
                                                             agreement.training_batch(dtype), config, parameters, true, jitter);
    Tensors losses = common_terms(result.losses, dtype);
    losses["code"] = Tensor::scalar(result.losses.code, dtype);
    losses["code_norm"] = Tensor::scalar(result.losses.code_norm, dtype);
    agreement.check("loss", losses);
    agreement.check("gradient", gradients_of(parameters, result.gradients), agreement.gradient_bound);
    Adam({config.optimizer.beta1, config.optimizer.beta2, config.optimizer.epsilon})
        .step(parameters, result.gradients, config.optimizer.learning_rate);
    agreement.check("stepped", values_of(parameters));
}

}  // namespace

TEST_CASE("a tiny decoder with its rays, images and mask, and all its gradients agree with PyTorch", "[agreement]") {
    const AgreementCase agreement = small_agreement("decoder", 9, {16, 8, 4, 6, 2, {5, 4}, 3, 2, 4});
    for (const DType dtype : {DType::float64, DType::float32}) decoder_agrees(agreement, dtype);
}

TEST_CASE("a first-stage step of a tiny model agrees with PyTorch", "[agreement]") {
    const AgreementCase agreement = small_agreement("stage1", 3, {64, 8, 2, 8, 3, {6, 5}, 2, 2, 16}, "squeezenet1_1");
    for (const DType dtype : {DType::float64, DType::float32}) first_stage_agrees(agreement, dtype);
}

TEST_CASE("the paper's decoder at 64 pixels and all its gradients agree with PyTorch", "[agreement][slow]") {
    if (const auto folder = golden_folder())
        for (const DType dtype : {DType::float64, DType::float32})
            decoder_agrees(full_agreement("decoder", *folder, dtype), dtype);
}

TEST_CASE("a first-stage step at the paper's width agrees with PyTorch", "[agreement][slow]") {
    if (const auto folder = golden_folder())
        for (const DType dtype : {DType::float64, DType::float32})
            first_stage_agrees(full_agreement("stage1", *folder, dtype), dtype);
}
