#include <catch2/catch.hpp>
#include <cmath>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "nn/losses.h"
#include "nn/models/discriminator.h"
#include "support/check_close.h"
#include "support/check_grad.h"
#include "support/error_message.h"
#include "support/live_nodes.h"

using namespace stymo;
using namespace stymo::test;

namespace {

Tensor column(std::initializer_list<double> values) {
    return Tensor::from({static_cast<std::int64_t>(values.size()), 1}, std::vector<double>(values));
}

}  // namespace

TEST_CASE("the adversarial losses are means of softplus of the logits") {
    const Tensor logits = column({2.0, -1.0});
    const double low = (std::log1p(std::exp(-2.0)) + std::log1p(std::exp(1.0))) / 2.0;
    const double high = (std::log1p(std::exp(2.0)) + std::log1p(std::exp(-1.0))) / 2.0;
    CHECK(generator_loss(logits).value().item() == Approx(low).epsilon(1e-12));
    CHECK(real_loss(logits).value().item() == Approx(low).epsilon(1e-12));
    CHECK(fake_loss(logits).value().item() == Approx(high).epsilon(1e-12));
    for (const auto& loss : {generator_loss, real_loss, fake_loss}) {
        const GradReport report = check_grad(
            "loss", [&](const std::vector<Variable>& x) { return loss(x[0]); }, {logits});
        INFO(report.message);
        CHECK(report.passed);
        CHECK(std::isfinite(loss(column({1e4, -1e4})).value().item()));
    }
}

TEST_CASE(
    "R1 of a linear discriminator is half the squared length of its weights, whatever the images") {
    Rng rng(1);
    const Variable weight = Variable::leaf(rng.normal({12, 1}, 0.0, 1.0, DType::float64));
    const Tensor images = rng.normal({3, 2, 2, 3}, 0.0, 1.0, DType::float64);
    const auto discriminator = [&](const Variable& x) {
        return matmul(reshape(x, {3, 12}), weight);
    };
    const Variable penalty = r1_penalty(discriminator, images);
    CHECK(penalty.value().item() ==
          Approx(sum(square(weight)).value().item() / 2.0).epsilon(1e-12));
    CHECK(check_close(grad(penalty, weight).value(), weight.value(), 1e-12).passed);
}

TEST_CASE("an image that fades in begins as its half resolution") {
    const Tensor image =
        Tensor::from({1, 2, 4, 1}, std::vector<double>{1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0});
    const std::vector<double> coarse{3.5, 3.5, 5.5, 5.5, 3.5, 3.5, 5.5, 5.5};
    CHECK(faded_image(image, 0.0).value().to_vector() == coarse);
    CHECK(identical(faded_image(image, 1.0).value(), image));
    const std::vector<double> half = faded_image(image, 0.25).value().to_vector();
    CHECK(half[0] == Approx(0.75 * 3.5 + 0.25 * 1.0));
    for (const double fade : {-0.05, 1.05})
        CHECK(is_one_line(error_message<ValueError>([&] { (void)faded_image(image, fade); })));
    CHECK(is_one_line(error_message<ShapeError>([&] {
        (void)faded_image(Tensor::zeros({1, 3, 3, 1}), 0.5);
    })));
}

namespace {

struct TestDiscriminator {
    ParameterStore store;
    Discriminator discriminator;

    TestDiscriminator()
        : discriminator([&] {
              Rng rng(1);
              return Discriminator({.max_channels = 4}, 64, store, "d", rng);
          }()) {
        store.convert(DType::float64);
    }
    Variable operator()(const Variable& images) const { return discriminator(images); }
    [[nodiscard]] std::vector<Variable> leaves() const { return variables_of(store.all()); }
};

}  // namespace

TEST_CASE(
    "R1 by double backward is what two gradients of a moved image tell, up to the square of the "
    "step") {
    // d/dtheta |g|^2 / 2 = d/dtheta (g . v) at a fixed v = g, and g . v is D's slope along v.
    const TestDiscriminator discriminator;
    const Tensor images = Rng(2).uniform({2, 64, 64, 3}, -1.0, 1.0, DType::float64);
    const std::vector<Variable> leaves = discriminator.leaves();
    const std::vector<Variable> exact = grad(r1_penalty(std::cref(discriminator), images), leaves);

    const Variable x = Variable::leaf(images);
    const Tensor v = grad(sum(discriminator(x)), x).value();
    const auto gradients_at = [&](double step) {
        return grad(sum(discriminator(Variable(images) + Variable(v) * step)), leaves);
    };
    // So short that no leaky ReLU bends within it: what is left is the curvature of the minibatch
    // deviation and rounding.
    constexpr double step = 1e-6;
    const std::vector<Variable> ahead = gradients_at(step), behind = gradients_at(-step);
    for (std::size_t i = 0; i < leaves.size(); ++i) {
        const Variable difference = (ahead[i] - behind[i]) * (0.5 / step / 2.0);
        const CloseReport report = check_close(difference.value(), exact[i].value(), 1e-5);
        INFO(discriminator.store.all()[i].name() << ": " << report.message);
        CHECK(report.passed);
    }
}

TEST_CASE("the gradient of R1 is that of central differences of its value") {
    const TestDiscriminator discriminator;
    const Tensor images = Rng(2).uniform({2, 64, 64, 3}, -1.0, 1.0, DType::float64);
    const auto penalty = [&] { return r1_penalty(std::cref(discriminator), images); };
    const std::vector<Variable> gradients = grad(penalty(), discriminator.leaves());
    for (const char* name : {"d.from_rgb64.weight", "d.block64.conv1.weight",
                             "d.block16.skip.weight", "d.epilogue.conv.weight"}) {
        for (std::size_t i = 0; i < gradients.size(); ++i) {
            const Parameter& parameter = discriminator.store.all()[i];
            if (parameter.name() != name) continue;
            const Tensor value = parameter.variable().value();
            const Variable direction =
                Rng(3).split(name).normal(value.shape(), 0.0, 1.0, DType::float64);
            constexpr double step = 1e-6;
            const auto value_at = [&](double along) {
                parameter.set_value((Variable(value) + direction * along).value());
                return penalty().value().item();
            };
            const double measured = (value_at(step) - value_at(-step)) / (2.0 * step);
            parameter.set_value(value);
            INFO(name);
            CHECK(measured == Approx(sum(gradients[i] * direction).value().item()).epsilon(1e-5));
        }
    }
}

TEST_CASE("nothing of R1's graph outlives it") {
    const TestDiscriminator discriminator;
    const LiveNodes nodes;
    {
        (void)grad(
            r1_penalty(std::cref(discriminator), Tensor::zeros({1, 64, 64, 3}, DType::float64)),
            discriminator.leaves());
    }
    CHECK(nodes.added() == 0);
}
