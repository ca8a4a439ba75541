#include <algorithm>
#include <catch2/catch.hpp>

#include "core/ops/ops.h"
#include "nn/known_pixels.h"
#include "nn/losses.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/live_nodes.h"
#include "train/loss_terms.h"
#include "train/step_gradients.h"
#include "train/tiny_training.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// Every term at once, so that no weight hides another's gradient; images of 64 and 128 pixels.
TrainConfig stage_config() {
    TrainConfig config = tiny_train_config();
    config.model.decoder.resolution = 128;
    config.model.decoder.block_channels = {6, 4};
    config.model.reconstruction.resolution_weights = {1.0, 1.0};
    config.loss.mask_weight = 0.5;
    config.loss.adversarial_weight = 0.3;
    return config;
}

/// Of the second stage, with the mask loss on.
TrainingPosition position_at(std::int64_t resolution, double fade) {
    return {.phase = {.stage = 2, .resolution = resolution, .samples_per_ray = 4},
            .fade = fade,
            .mask_loss = true};
}

struct Stage {
    TrainConfig config = stage_config();
    Model model;
    ParameterStore discriminator_parameters;
    Discriminator discriminator;
    ReconstructionLoss reconstruction;
    TrainingPosition position = position_at(128, 0.3);

    explicit Stage(std::int64_t group_size = 2)
        : model([&] {
              Rng rng(1);
              return Model(config.model, rng);
          }()),
          discriminator([&] {
              Rng rng(2);
              return Discriminator({.max_channels = 4, .group_size = group_size}, 128,
                                   discriminator_parameters, "discriminator", rng);
          }()),
          reconstruction(config.model.reconstruction, "perceptual_weight") {
        model.parameters().convert(DType::float64);
        discriminator_parameters.convert(DType::float64);
    }

    [[nodiscard]] GeneratorInputs inputs() const {
        return {model, reconstruction, config, nullptr, &discriminator};
    }
    [[nodiscard]] LossAndGradients classify(const FaceBatch& batch,
                                            const std::vector<Parameter>& parameters,
                                            std::uint64_t seed = 3) const {
        Rng jitter(seed);
        return discriminator_gradients(inputs(), position, batch, parameters, jitter);
    }
    [[nodiscard]] LossAndGradients r1(const FaceBatch& batch,
                                      const std::vector<Parameter>& parameters,
                                      double weight = 1.0) const {
        return r1_gradients(discriminator, position, batch, weight, parameters);
    }
    [[nodiscard]] LossAndGradients generate(const FaceBatch& batch,
                                            const std::vector<Parameter>& parameters) const {
        Rng jitter(3);
        return generator_gradients(inputs(), position, batch, parameters, jitter);
    }
};

/// Images of noise.
FaceBatch noise(std::int64_t first, std::int64_t count) {
    const auto rows = [&](const Shape& one, double low, std::uint64_t seed) {
        const Tensor all = Rng(seed).uniform(one.with(0, 4), low, 1.0, DType::float64);
        return slice(all, 0, first, first + count).value();
    };
    FaceBatch batch;
    batch.input = rows({1, 128, 128, 3}, -1.0, 1);
    batch.targets = {rows({1, 64, 64, 3}, -1.0, 2), rows({1, 128, 128, 3}, -1.0, 3)};
    batch.mask = rows({1, 128, 128, 1}, 0.0, 4);
    batch.ray_mask = rows({1, 32, 32, 1}, 0.0, 5);
    for (std::int64_t i = first; i < first + count; ++i)
        batch.cameras.push_back(camera_from_pose(
            {.yaw = 0.1 * static_cast<double>(i), .translation = {0.5, 0.2, 5.3}}, {}));
    for (std::size_t i = 0; i < code_sizes.size(); ++i)
        batch.codes[i] = Tensor::zeros({count, code_sizes[i]}, DType::float64);
    batch.code_present = Tensor::zeros({count}, DType::float64);
    return batch;
}

/// Compares the gradient of the first parameter of each of these names with central differences of
/// `value`, along one direction.
template <class Value>
void check_gradients(const std::vector<Parameter>& parameters,
                     const std::vector<Variable>& gradients,
                     std::initializer_list<const char*> names, Value value) {
    for (const char* name : names) {
        const auto found = std::ranges::find_if(
            parameters, [&](const Parameter& p) { return p.name().starts_with(name); });
        INFO(name);
        REQUIRE(found != parameters.end());
        const Tensor before = found->variable().value();
        const Variable direction =
            Rng(4).split(name).normal(before.shape(), 0.0, 1.0, DType::float64);
        constexpr double step = 1e-6;
        const auto value_at = [&](double along) {
            found->set_value((Variable(before) + direction * along).value());
            return value();
        };
        const double measured = (value_at(step) - value_at(-step)) / (2.0 * step);
        found->set_value(before);
        const Variable& gradient = gradients[static_cast<std::size_t>(found - parameters.begin())];
        CHECK(measured ==
              Approx(sum(gradient * direction).value().item()).epsilon(2e-5).margin(1e-9));
    }
}

void check_equal(const std::vector<Variable>& actual, const std::vector<Variable>& expected) {
    REQUIRE(actual.size() == expected.size());
    for (std::size_t i = 0; i < actual.size(); ++i)
        CHECK(identical(actual[i].value(), expected[i].value()));
}

}  // namespace

TEST_CASE("the gradient of the discriminator's loss is that of central differences",
          "[adversarial]") {
    const Stage stage;
    const FaceBatch batch = noise(0, 2);
    const std::vector<Parameter> parameters = stage.discriminator_parameters.trainable();
    const LossAndGradients result = stage.classify(batch, parameters);
    CHECK(result.losses["discriminator"] > 0.0);
    CHECK(result.losses["r1"] == 0.0);
    CHECK(result.losses["real_logit"] != result.losses["fake_logit"]);
    check_gradients(
        parameters, result.gradients,
        {"discriminator.from_rgb64", "discriminator.from_rgb128", "discriminator.block128.conv0",
         "discriminator.block64.skip", "discriminator.epilogue.logit"},
        [&] { return stage.classify(batch, {}).losses["discriminator"]; });
}

TEST_CASE("R1's gradient is that of central differences, times its weight", "[adversarial]") {
    const Stage stage;
    const FaceBatch batch = noise(0, 2);
    const std::vector<Parameter> parameters = stage.discriminator_parameters.trainable();
    const LossAndGradients result = stage.r1(batch, parameters, 2.5);
    CHECK(result.losses["discriminator"] == 0.0);
    check_gradients(parameters, result.gradients,
                    {"discriminator.from_rgb128", "discriminator.block64.conv1"},
                    [&] { return 2.5 * stage.r1(batch, {}).losses["r1"]; });
}

TEST_CASE("R1's gradient through augmented photos is that of central differences",
          "[adversarial]") {
    const Stage stage;
    const FaceBatch batch = noise(0, 2);
    const std::vector<ImageAugmentation> augmentations{drawn_augmentation(Rng(1), 1.0),
                                                       drawn_augmentation(Rng(2), 1.0)};
    const std::vector<Parameter> parameters = stage.discriminator_parameters.trainable();
    const auto r1 = [&](const std::vector<Parameter>& wanted) {
        return r1_gradients(stage.discriminator, stage.position, batch, 3.0, wanted, augmentations);
    };
    const LossAndGradients result = r1(parameters);
    CHECK(result.losses.total != Approx(stage.r1(batch, {}).losses.total));
    check_gradients(parameters, result.gradients, {"discriminator.", "discriminator.block64"},
                    [&] { return 3.0 * r1({}).losses.total; });
}

TEST_CASE("the gradient of the generator's loss is that of central differences", "[adversarial]") {
    const Stage stage;
    const FaceBatch batch = noise(0, 2);
    const std::vector<Parameter> parameters = stage.model.parameters().trainable();
    const LossAndGradients result = stage.generate(batch, parameters);
    for (const double term :
         {result.losses["reconstruction"], result.losses["mask"], result.losses["opacity"],
          result.losses["depth_variance"], result.losses["adversarial"]})
        CHECK(term > 0.0);
    CHECK(result.losses["code"] == 0.0);
    CHECK(result.losses.total ==
          Approx(result.losses["reconstruction"] + 0.5 * result.losses["mask"] +
                 0.2 * result.losses["opacity"] + 0.2 * result.losses["depth_variance"] +
                 0.3 * result.losses["adversarial"]));
    check_gradients(
        parameters, result.gradients,
        {"decoder.mapping.id", "decoder.mapping.tex", "decoder.field.layer0",
         "decoder.field.feature1", "decoder.block64", "decoder.block128", "decoder.mask"},
        [&] { return stage.generate(batch, {}).losses.total; });
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        if (!parameters[i].name().starts_with("encoder.")) continue;
        CHECK(identical(result.gradients[i].value(),
                        Tensor::zeros(parameters[i].variable().shape(), DType::float64)));
    }
}

TEST_CASE("the gradients of a batch with unknown pixels are those of central differences",
          "[adversarial][unknown]") {
    const Stage stage;
    FaceBatch batch = noise(0, 2);
    batch.known = Tensor::full({2, 128, 128, 1}, 1.0);
    std::ranges::fill(batch.known.mutable_values<float>().subspan(128 * 128, 128 * 50), 0.0F);
    for (Tensor& target : batch.targets) target = seen_by_discriminator(target, batch).value();
    const auto with_other_mask = [&] {
        FaceBatch other = batch;
        other.mask = where_known(batch.known, batch.mask, 0.5).value();
        return other;
    };
    const std::vector<Parameter> parameters = stage.model.parameters().trainable();
    const LossAndGradients result = stage.generate(batch, parameters);
    CHECK(result.losses.total < stage.generate(noise(0, 2), {}).losses.total);
    CHECK(result.losses["mask"] == stage.generate(with_other_mask(), {}).losses["mask"]);
    check_gradients(
        parameters, result.gradients,
        {"decoder.mapping.id", "decoder.field.layer0", "decoder.block128", "decoder.mask"},
        [&] { return stage.generate(batch, {}).losses.total; });
    const std::vector<Parameter> classifier = stage.discriminator_parameters.trainable();
    check_gradients(classifier, stage.classify(batch, classifier).gradients,
                    {"discriminator.from_rgb128", "discriminator.block64.skip"},
                    [&] { return stage.classify(batch, {}).losses["discriminator"]; });
}

TEST_CASE("what the discriminator sees is augmented, photos and rendered images each their way",
          "[adversarial]") {
    const Stage stage;
    const std::vector<Parameter> parameters = stage.discriminator_parameters.trainable();
    const FaceBatch batch = noise(0, 2);
    FaceBatch flipped = batch;
    for (Tensor& images : flipped.targets) images = flip(images, 2).value();
    const ImageAugmentation mirror{.source_from_target = {-1, 0, 0, 0, 1, 0}};
    const std::vector<ImageAugmentation> of_photos{mirror, mirror, {}, {}};
    Rng jitter(3);
    GeneratorInputs inputs = stage.inputs();
    inputs.augmentations = of_photos;
    const LossAndGradients seen =
        discriminator_gradients(inputs, stage.position, batch, parameters, jitter);
    const LossAndGradients expected = stage.classify(flipped, parameters);
    CHECK(seen.losses.total == Approx(expected.losses.total).epsilon(1e-10));
    CHECK(seen.losses["real_logit"] == Approx(expected.losses["real_logit"]).epsilon(1e-10));
    // A mirror does not change the length of a gradient.
    const LossAndGradients penalty = r1_gradients(stage.discriminator, stage.position, batch, 1.0,
                                                  parameters, std::span(of_photos).first(2));
    CHECK(penalty.losses["r1"] ==
          Approx(stage.r1(flipped, parameters).losses["r1"]).epsilon(1e-10));
    for (std::size_t i = 0; i < parameters.size(); ++i)
        CHECK(check_close(penalty.gradients[i].value(),
                          stage.r1(flipped, parameters).gradients[i].value(), 1e-9)
                  .passed);
}

TEST_CASE("micro-batches add up to the batch, draw for draw", "[adversarial]") {
    const Stage stage(1);  // alone in its group, no image sees another
    const std::vector<Parameter> parameters = stage.discriminator_parameters.trainable();
    const LossAndGradients whole = stage.classify(noise(0, 2), parameters);
    Rng jitter(3);
    LossValues terms;
    std::vector<std::vector<Variable>> parts;
    for (const std::int64_t i : {0, 1}) {
        parts.push_back({});
        const LossAndGradients part = discriminator_gradients(stage.inputs(), stage.position,
                                                              noise(i, 1), parameters, jitter);
        terms.accumulate(part.losses, 0.5);
        parts.back() = part.gradients;
    }
    CHECK(terms["discriminator"] == Approx(whole.losses["discriminator"]).epsilon(1e-10));
    CHECK(terms["fake_logit"] == Approx(whole.losses["fake_logit"]).epsilon(1e-10));
    CHECK(terms["real_logit"] == Approx(whole.losses["real_logit"]).epsilon(1e-10));
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        const Variable mean = (parts[0][i] + parts[1][i]) * 0.5;
        CHECK(check_close(mean.value(), whole.gradients[i].value(), 1e-9).passed);
    }
}

TEST_CASE("what is not updated may be frozen or not: the gradients are the same, bit for bit",
          "[adversarial]") {
    Stage stage;
    const FaceBatch batch = noise(0, 2);
    const std::vector<Parameter> decoder = stage.model.parameters().trainable();
    const std::vector<Parameter> parameters_of_discriminator =
        stage.discriminator_parameters.trainable();
    const LossAndGradients generated = stage.generate(batch, decoder);
    const LossAndGradients classified = stage.classify(batch, parameters_of_discriminator);
    stage.discriminator_parameters.set_trainable("", false);
    check_equal(stage.generate(batch, decoder).gradients, generated.gradients);
    stage.discriminator_parameters.set_trainable("", true);
    stage.model.parameters().set_trainable("", false);
    const LiveNodes nodes;
    check_equal(stage.classify(batch, parameters_of_discriminator).gradients, classified.gradients);
    CHECK(nodes.added() == 0);
}

TEST_CASE("a phase below the model's resolution uses its images alone, and no mask",
          "[adversarial]") {
    Stage stage;
    stage.position = position_at(64, 1.0);
    const FaceBatch batch = noise(0, 2);
    const std::vector<Parameter> parameters = stage.model.parameters().trainable();
    const LossAndGradients result = stage.generate(batch, parameters);
    CHECK(result.losses["mask"] == 0.0);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        if (!parameters[i].name().starts_with("decoder.block128.") &&
            !parameters[i].name().starts_with("decoder.mask."))
            continue;
        CHECK(identical(result.gradients[i].value(),
                        Tensor::zeros(parameters[i].variable().shape(), DType::float64)));
    }
    const std::vector<Parameter> parameters_of_discriminator =
        stage.discriminator_parameters.trainable();
    const double of_photos = stage.r1(batch, {}).losses["r1"];
    const double expected =
        r1_penalty([&](const Variable& x) { return stage.discriminator(x); }, batch.targets[0])
            .value()
            .item();
    CHECK(of_photos == expected);
}

TEST_CASE("without adversarial weight no discriminator is needed", "[adversarial]") {
    Stage stage;
    stage.config.loss.adversarial_weight = 0.0;
    stage.position.mask_loss = false;
    Rng jitter(3);
    const LossAndGradients result = generator_gradients(
        {stage.model, stage.reconstruction, stage.config}, stage.position, noise(0, 1), {}, jitter);
    CHECK(result.losses["adversarial"] == 0.0);
    CHECK(result.losses["mask"] == 0.0);
    CHECK(result.losses.total > 0.0);
}

TEST_CASE("a batch without the phase's images is refused in one line", "[adversarial]") {
    const Stage stage;
    FaceBatch batch = noise(0, 2);
    batch.targets.pop_back();
    const auto classify = [&] { (void)stage.classify(batch, {}); };
    CHECK(is_one_line(error_message<ShapeError>(classify)));
    CHECK(is_one_line(error_message<ShapeError>([&] { (void)stage.r1(batch, {}); })));
}
