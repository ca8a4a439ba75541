#include <algorithm>
#include <catch2/catch.hpp>

#include "core/error.h"
#include "fit/photo/model_mask.h"
#include "nn/realtime/view.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

TEST_CASE("the probability of a head is the opacity of the face that the encoder sees",
          "[model_mask]") {
    Model model = tiny_model(1);
    model.parameters().set_trainable("", false);
    const Tensor crop = Rng(3).uniform({16, 16, 3}, 0.0, 1.0);
    const Pose pose = orbit_pose(0.2, -0.1, 0.0, 5.3);
    const Tensor probability = head_probability(model, crop, pose, {});
    REQUIRE(probability.shape() == Shape{16, 16, 1});

    Tensor input({1, 16, 16, 3});
    std::ranges::transform(crop.values<float>(), input.mutable_values<float>().begin(),
                           [](float value) { return 2.0F * value - 1.0F; });
    const Decoded face = model.decoder()(model.encoder()(input), {camera_from_pose(pose, {})},
                                         {.samples_per_ray = 24});
    const std::span<const float> transmittance = face.weights.transmittance.value().values<float>();
    // Of 8 x 8 rays each covers four pixels; interpolation stays between the neighbours' values.
    const auto [least, most] = std::ranges::minmax(transmittance);
    double mean_opacity = 0.0, mean_probability = 0.0;
    for (const float value : transmittance) mean_opacity += (1.0 - value) / 64.0;
    for (const float value : probability.values<float>()) {
        CHECK(value >= 1.0F - most - 0.1F);
        CHECK(value <= 1.0F - least + 0.1F);
        mean_probability += value / 256.0;
    }
    CHECK(mean_probability == Approx(mean_opacity).margin(0.02));
}

TEST_CASE("a model without an encoder knows no heads of photos", "[model_mask]") {
    ModelConfig config = tiny_model_config();
    config.code_source = "morphable";
    Rng rng(1);
    const Model model(config, rng);
    CHECK_THROWS_AS(head_probability(model, Tensor::zeros({16, 16, 3}), {}, {}), ValueError);
}
