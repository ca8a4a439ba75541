#include <catch2/catch.hpp>

#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/models/reconstruction.h"
#include "nn/pretrained/perceptual/feature_distance.h"
#include "support/check_grad.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

Model frozen_model() {
    Model model = tiny_model(1);
    model.parameters().convert(DType::float64);
    model.parameters().set_trainable("", false);
    return model;
}

Tensor images(std::uint64_t seed, std::int64_t side) {
    return Rng(seed).uniform({2, side, side, 3}, -1.0, 1.0, DType::float64);
}

}  // namespace

TEST_CASE("the encoder's distance is the mean over layers of that of normalised activations",
          "[encoder_distance]") {
    const Model model = frozen_model();
    const EncoderDistance distance(model.encoder());
    const Tensor photo = images(1, 48), image = images(2, 48);
    const std::vector<Variable> a = model.encoder().backbone().activations(photo),
                                b = model.encoder().backbone().activations(image);
    REQUIRE(a.size() == 5);
    Variable expected = Tensor::zeros({2}, DType::float64);
    for (std::size_t i = 0; i < a.size(); ++i) {
        const auto unit = [](const Variable& x) {
            return x / (sqrt(sum(square(x), {3})) + feature_epsilon);
        };
        expected =
            expected + reshape(mean(sum(square(unit(a[i]) - unit(b[i])), {3}), {1, 2}), {2}) / 5.0;
    }
    const Variable actual = distance.distance_to(image, distance.features(photo));
    for (std::size_t i = 0; i < 2; ++i)
        CHECK(actual.value().to_vector()[i] == Approx(expected.value().to_vector()[i]));
    CHECK(sum(distance.distance_to(photo, distance.features(photo))).value().item() < 1e-12);
}

TEST_CASE("the encoder's distance has the gradient of its finite differences",
          "[encoder_distance]") {
    const Model model = frozen_model();
    const EncoderDistance distance(model.encoder());
    const EncoderDistance::Features photo = distance.features(images(1, 32));
    const auto report = check_grad(
        "encoder distance",
        [&](const std::vector<Variable>& x) { return sum(distance.distance_to(x[0], photo)); },
        {images(2, 32)}, {.order = 1, .step = 1e-6});
    INFO(report.message);
    CHECK(report.passed);
}

TEST_CASE("the reconstruction loss takes the encoder where it is the perceptual network",
          "[encoder_distance]") {
    const Model model = frozen_model();
    ReconstructionConfig config = model.config().reconstruction;
    config.perceptual_weight = 0.5;
    config.perceptual = {.network = encoder_network};
    CHECK_THAT(error_message<ConfigError>([&] { const ReconstructionLoss training(config); }),
               Catch::Contains("fitting alone"));
    const ReconstructionLoss loss(config, "off", &model.encoder());
    CHECK(loss.lpips() == nullptr);
    const std::vector<Tensor> photos{images(1, 32)};
    const ReconstructionLoss::Terms terms =
        loss({Variable(images(2, 32))}, loss.kept_target(photos));
    CHECK(terms.total.value().item() ==
          Approx(terms.photometric.value().item() + 0.5 * terms.perceptual.value().item()));
}

TEST_CASE("a backbone that gives no activations is refused", "[encoder_distance]") {
    ModelConfig config = tiny_model_config();
    config.encoder.backbone = "mobilefacenet";
    Rng rng(1);
    const Model model(config, rng);
    CHECK_THROWS_WITH(EncoderDistance(model.encoder()), Catch::Contains("small_conv"));
}
