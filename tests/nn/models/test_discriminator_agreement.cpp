#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/losses.h"
#include "nn/models/discriminator.h"
#include "support/golden.h"

namespace discriminator_agreement_tests {

using namespace stymo;
using namespace stymo::test;

// The numbers are PyTorch's, in float64: tests/golden/make_discriminator_vectors.py, which has the
// same sizes.
namespace {

using Tensors = std::map<std::string, Tensor>;

struct Case {
    std::string name;
    DiscriminatorConfig config;
    std::int64_t resolution;
    std::int64_t side;
    std::int64_t batch;
    double fade;
};

Tensor image(const std::string& name, const Case& c, DType dtype) {
    Tensor values = golden_numbers(name, {c.batch, c.side, c.side, 3});
    for (double& value : values.mutable_values<double>()) value = static_cast<float>(value / 1.75);
    return faded_image(Variable(values), c.fade).value().to(dtype);
}

Tensors gradients(const Variable& loss, const ParameterStore& store) {
    const std::vector<Variable> found = grad(loss, variables_of(store.all()));
    Tensors result;
    for (std::size_t i = 0; i < found.size(); ++i) result[store.all()[i].name()] = found[i].value();
    return result;
}

double largest(const Tensors& tensors) {
    double result = 0.0;
    for (const auto& [name, tensor] : tensors)
        for (const double value : tensor.to_vector()) result = std::max(result, std::abs(value));
    return result;
}

/// `gradient_bound`: of gradients in float32, where the more a leaky ReLU's zero decides, the wider
/// the network is.
void agrees(const GoldenVectors& vectors, const Case& c, DType dtype, bool report,
            double gradient_bound = 1e-4) {
    Rng rng(1);
    ParameterStore store;
    const Discriminator discriminator(c.config, c.resolution, store, "discriminator", rng);
    set_golden_parameters(store, dtype);
    const Tensor real = image("discriminator.real", c, dtype);
    Tensors values{{"images", real}};
    {
        const Variable images = Variable::leaf(real);
        const Variable real_logits = discriminator(images, c.fade);
        const Variable fake_logits =
            discriminator(Variable(image("discriminator.fake", c, dtype)), c.fade);
        const Variable loss = real_loss(real_logits) + fake_loss(fake_logits);
        values["real_logits"] = real_logits.value();
        values["fake_logits"] = fake_logits.value();
        values["loss"] = loss.value();
        Tensors first_order = gradients(loss, store);
        first_order["dlogits_dx"] = grad(sum(real_logits), images).value();
        vectors.check(c.name + "/loss_gradient", first_order, report, 1e-6, gradient_bound);
    }
    const Variable penalty =
        r1_penalty([&](const Variable& x) { return discriminator(x, c.fade); }, real);
    values["r1"] = penalty.value();
    vectors.check(c.name + "/value", values, report);
    // Behind leaky ReLUs R1 depends on a bias through the minibatch deviation alone, if at all:
    // rounding errors of the weights' gradients stand beside numbers near 0.
    const Tensors r1_gradients = gradients(penalty, store);
    vectors.check(c.name + "/r1_gradient", r1_gradients, report, 0.1 * largest(r1_gradients));
}

}  // namespace

TEST_CASE("small discriminators, faded in or not, and their R1 agree with PyTorch", "[agreement]") {
    const GoldenVectors vectors(STYMO_SOURCE_DIR "/tests/golden/discriminator_vectors.safetensors",
                                true);
    for (const DType dtype : {DType::float64, DType::float32}) {
        agrees(vectors, {"side64", {.max_channels = 8, .group_size = 2}, 128, 64, 4, 1.0}, dtype,
               false);
        agrees(vectors, {"side128", {.max_channels = 8, .group_size = 4}, 128, 128, 4, 0.3}, dtype,
               false);
    }
}

TEST_CASE("a discriminator of the paper's width and its R1 agree with PyTorch",
          "[agreement][slow]") {
    const auto folder = golden_folder();
    if (!folder) return;
    const GoldenVectors vectors(*folder / "discriminator_vectors.safetensors", false);
    const std::int64_t side = vectors.shape("full/value/images")[1];
    for (const DType dtype : {DType::float64, DType::float32})
        agrees(vectors, {"full", {}, side, side, 2, 1.0}, dtype, true, 1e-3);
}

}  // namespace discriminator_agreement_tests
