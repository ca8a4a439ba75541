#include <catch2/catch.hpp>
#include <cmath>

#include "core/matmul_precision.h"
#include "core/ops/ops.h"
#include "nn/realtime/view.h"
#include "train/step_gradients.h"
#include "train/tiny_training.h"

using namespace stymo;
using namespace stymo::test;

namespace {

FaceBatch batch_in_float64(std::int64_t count) {
    const Dataset faces = synthetic_dataset();
    std::vector<Face> chosen;
    for (std::int64_t i = 0; i < count; ++i) chosen.push_back(faces.load(i));
    FaceBatch batch = make_batch(chosen);
    const auto widen = [](Tensor& tensor) { tensor = tensor.to(DType::float64); };
    widen(batch.input);
    widen(batch.mask);
    widen(batch.ray_mask);
    widen(batch.code_present);
    for (Tensor& target : batch.targets) widen(target);
    for (Tensor& codes : batch.codes) widen(codes);
    return batch;
}

/// The first step, with the mask loss on.
TrainingPosition first_position(const TrainConfig& config) {
    TrainingPosition position = TrainingSchedule(config).position(0);
    position.mask_loss = true;
    return position;
}

/// Every term at once, so that no weight hides another's gradient.
TrainConfig config_with_all_terms() {
    TrainConfig config = tiny_train_config();
    config.loss.code_weights = {0.1, 0.1, 0.1, 0.1};
    config.loss.mask_weight = 0.5;
    config.model.encoder.expression_backbone = "landmarks";
    config.model.encoder.expression_weights = random_backbone;
    config.loss.expression_weight = 0.5;
    return config;
}

/// The gradients of all weights in the first step, one after the other.
std::vector<double> all_gradients(const Model& model, const TrainConfig& config,
                                  const FaceBatch& batch) {
    Rng jitter(2);
    const ReconstructionLoss reconstruction(config.model.reconstruction);
    std::vector<double> all;
    for (const Variable& gradient :
         generator_gradients({model, reconstruction, config}, first_position(config), batch,
                             model.parameters().trainable(), jitter)
             .gradients) {
        const std::vector<double> values = gradient.value().to_vector();
        all.insert(all.end(), values.begin(), values.end());
    }
    return all;
}

}  // namespace

TEST_CASE("the gradient of the whole loss is that of central differences for encoder and decoder",
          "[reconstruction]") {
    const TrainConfig config = config_with_all_terms();
    const FaceBatch batch = batch_in_float64(2);
    REQUIRE(batch.has_codes());
    Rng weights(1);
    Model model(config.model, weights);
    model.parameters().convert(DType::float64);
    const std::vector<Parameter> parameters = model.parameters().trainable();
    const ReconstructionLoss reconstruction(config.model.reconstruction);
    const auto evaluate = [&](const std::vector<Parameter>& wanted) {
        Rng jitter(2);
        return generator_gradients({model, reconstruction, config}, first_position(config), batch,
                                   wanted, jitter);
    };
    const LossAndGradients result = evaluate(parameters);
    for (const double term :
         {result.losses["reconstruction"], result.losses["code"], result.losses["mask"],
          result.losses["opacity"], result.losses["depth_variance"], result.losses["expression"]})
        CHECK(term > 0.0);

    std::size_t checked = 0;
    for (const char* name :
         {"encoder.backbone.conv0.weight", "encoder.backbone.embed.bias", "encoder.heads.expr",
          "encoder.heads.light", "decoder.mapping.id", "decoder.mapping.tex",
          "decoder.field.layer0", "decoder.field.density", "decoder.field.feature0",
          "decoder.field.feature1", "decoder.block64", "decoder.mask"}) {
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            if (!parameters[i].name().starts_with(name)) continue;
            const Tensor value = parameters[i].variable().value();
            Rng rng = Rng(3).split(parameters[i].name());
            const std::vector<double> direction =
                rng.normal(value.shape(), 0.0, 1.0, DType::float64).to_vector();
            const std::vector<double> gradient = result.gradients[i].value().to_vector();
            double expected = 0.0;
            for (std::size_t k = 0; k < direction.size(); ++k)
                expected += gradient[k] * direction[k];

            const auto loss_at = [&](double step) {
                std::vector<double> moved = value.to_vector();
                for (std::size_t k = 0; k < moved.size(); ++k) moved[k] += step * direction[k];
                parameters[i].set_value(
                    Tensor::from(value.shape(), std::span<const double>(moved)));
                return evaluate({}).losses.total;
            };
            constexpr double step = 1e-6;
            const double measured = (loss_at(step) - loss_at(-step)) / (2.0 * step);
            parameters[i].set_value(value);
            INFO(parameters[i].name());
            CHECK(measured == Approx(expected).epsilon(1e-5).margin(1e-8));
            ++checked;
            break;
        }
    }
    CHECK(checked == 12);
}

TEST_CASE("gradients of a step of medium precision are near those of float64", "[reconstruction]") {
    TrainConfig config = config_with_all_terms();
    config.optimizer.sample_tolerance = 0.001;  // as the configurations that ship have it
    // That backbone is not trained, and random codes differ by next to nothing, by which the term
    // divides.
    config.model.encoder.expression_backbone = no_backbone;
    config.loss.expression_weight = 0.0;
    const std::vector<double> exact = [&] {
        Rng weights(1);
        Model model(config.model, weights);
        model.parameters().convert(DType::float64);
        return all_gradients(model, config, batch_in_float64(2));
    }();
    const auto error = [&] {
        Rng weights(1);
        const Dataset faces = synthetic_dataset();
        const std::vector<double> rounded =
            all_gradients(Model(config.model, weights), config,
                          make_batch(std::vector{faces.load(0), faces.load(1)}));
        double squares = 0.0, all = 0.0;
        for (std::size_t i = 0; i < exact.size(); ++i) {
            squares += (rounded[i] - exact[i]) * (rounded[i] - exact[i]);
            all += exact[i] * exact[i];
        }
        return std::sqrt(squares / all);
    };
    CHECK(error() < 1e-4);
    for (const bool emulated : {false, true}) {
        const PrecisionScope lowered(MatmulPrecision::medium, emulated);
        const double of_medium = error();
        INFO("emulated " << emulated << ", error " << of_medium);
        CHECK(of_medium < 5e-2);
        CHECK((of_medium > 1e-4) ==
              (computed_precision(MatmulPrecision::medium) == MatmulPrecision::medium));
    }
}

TEST_CASE("terms without weight, or whose time has not come, are neither computed nor reported",
          "[reconstruction]") {
    TrainConfig config = tiny_train_config();
    config.loss.opacity_weight = 0.0;
    config.loss.depth_variance_weight = 0.0;
    config.loss.code_norm_weight = 0.0;
    config.loss.code_weights = {0.0, 0.0, 0.0, 0.0};
    const Dataset faces = synthetic_dataset();
    const FaceBatch batch = make_batch(std::vector{faces.load(0)});
    Rng weights(1);
    const Model model(config.model, weights);
    Rng jitter(2);
    const ReconstructionLoss reconstruction(config.model.reconstruction);
    const LossValues losses =
        generator_gradients({model, reconstruction, config}, TrainingSchedule(config).position(0),
                            batch, {}, jitter)
            .losses;
    CHECK(losses.total == losses["reconstruction"]);
    CHECK(losses["code"] == 0.0);
    CHECK(losses["mask"] == 0.0);
    CHECK(losses["opacity"] == 0.0);
    CHECK(losses["depth_variance"] == 0.0);
}

TEST_CASE("samples below the shipped tolerance bias the gradient of a step by less than a percent",
          "[reconstruction]") {
    TrainConfig config = config_with_all_terms();
    const FaceBatch batch = batch_in_float64(1);
    Rng weights(1);
    Model model(config.model, weights);
    // A field in which most rays end.
    for (const Parameter& parameter : model.parameters().all())
        if (parameter.name() == "decoder.field.density.bias")
            parameter.set_value(Tensor::full({1}, 4.0));
    model.parameters().convert(DType::float64);
    const std::vector<Parameter> parameters = model.parameters().trainable();
    const ReconstructionLoss reconstruction(config.model.reconstruction);
    const auto evaluate = [&](double tolerance) {
        config.optimizer.sample_tolerance = tolerance;
        TrainingPosition position = first_position(config);
        position.phase.samples_per_ray = 16;
        Rng jitter(2);
        return generator_gradients({model, reconstruction, config}, position, batch, parameters,
                                   jitter);
    };
    const auto bias = [&](double tolerance) {
        const LossAndGradients exact = evaluate(0.0), shipped = evaluate(tolerance);
        CHECK(shipped.losses.total == Approx(exact.losses.total).epsilon(1e-12));
        CHECK(shipped.losses[significant_share] < 0.95);
        double difference = 0.0, length = 0.0;
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            difference += sum(square(shipped.gradients[i] - exact.gradients[i])).value().item();
            length += sum(square(exact.gradients[i])).value().item();
        }
        return std::sqrt(difference / length);
    };
    const double of_shipped = bias(0.001), of_tenth = bias(0.0001);
    CAPTURE(of_shipped, of_tenth);
    CHECK(of_shipped > 0.0);
    CHECK(of_shipped < 0.01);
    CHECK(of_tenth < of_shipped);
}

TEST_CASE("the expression term is the part of an asked change that the encoder does not see",
          "[reconstruction]") {
    TrainConfig config = config_with_all_terms();
    const Dataset faces = synthetic_dataset();
    const FaceBatch batch = make_batch(std::vector{faces.load(0), faces.load(1), faces.load(2)});
    Rng weights(1);
    const Model model(config.model, weights);
    const TrainingPosition position = first_position(config);
    Rng jitter(2);
    const ReconstructionLoss reconstruction(config.model.reconstruction);
    const double term =
        generator_gradients({model, reconstruction, config}, position, batch, {}, jitter)
            .losses["expression"];

    // One face of three gets the expression of the second; the third takes no part.
    Codes codes = face_codes(model, batch, nullptr);
    const auto row = [&](std::size_t group, std::int64_t at) {
        return slice(codes.groups[group], 0, at, at + 1);
    };
    const Decoded face = model.decoder()({{row(0, 0), row(1, 1), row(2, 0), row(3, 0)}},
                                         {batch.cameras.front()}, {.samples_per_ray = 4});
    const std::vector<ImageAugmentation> frames{
        ffhq_frame(batch.cameras.front(), config.model.camera)};
    const Variable seen = model.encoder().expression(augmented(face.images.back(), frames));
    const auto size = [](const Variable& x) { return mean(square(x)).value().item(); };
    const double asked = size(row(1, 1) - row(1, 0)) + 0.2 * size(codes.groups[1]);
    CHECK(term == Approx(size(seen - row(1, 1)) / asked).epsilon(1e-4));
}

TEST_CASE("the identity terms compare rendered faces with the photo, from a side too",
          "[reconstruction]") {
    TrainConfig config = tiny_train_config();
    const IdentityNetwork network("random");
    // The photo that the identity is read from is another one, from another camera.
    const Dataset faces = synthetic_dataset();
    const std::vector<Face> shown{faces.load(0)}, read{faces.load(1)};
    FaceBatch batch = make_batch(shown);
    read_people_from(batch, shown, read, {Shared::person});
    Rng weights(1);
    const Model model(config.model, weights);
    const ReconstructionLoss reconstruction(config.model.reconstruction);
    const auto evaluate = [&](double weight, double side_weight) {
        config.loss.identity_weight = weight;
        config.loss.side_identity_weight = side_weight;
        Rng jitter(2);
        return generator_gradients({.model = model,
                                    .reconstruction = reconstruction,
                                    .config = config,
                                    .identity = &network},
                                   first_position(config), batch, model.parameters().trainable(),
                                   jitter);
    };
    const LossAndGradients with = evaluate(0.5, 0.25), without = evaluate(0.0, 0.0);
    CHECK(with.losses["identity"] > 0.0);
    CHECK(with.losses.total == Approx(without.losses.total + 0.5 * with.losses["identity"] +
                                      0.25 * with.losses["side_identity"])
                                   .epsilon(1e-5));
    double change = 0.0;
    for (std::size_t i = 0; i < with.gradients.size(); ++i)
        change += sum(abs(with.gradients[i] - without.gradients[i])).value().item();
    CHECK(change > 0.0);

    const auto embedding = [&](const Variable& image, const Camera& camera) {
        const std::vector<ImageAugmentation> frame{ffhq_frame(camera, config.model.camera)};
        return network.embeddings(augmented(image, frame));
    };
    const Camera aside = model_camera(model, -0.5, 0.0, 0.0);
    const Decoded face =
        model.decoder()(face_codes(model, batch, nullptr), {aside}, {.samples_per_ray = 4});
    const Variable cosine =
        sum(embedding(face.images.back(), aside) *
            embedding(Variable(batch.other_input), batch.other_cameras.front()));
    CHECK(with.losses["side_identity"] == Approx(1.0 - cosine.value().item()).epsilon(1e-4));
}
