#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/image_augmentation.h"
#include "nn/known_pixels.h"
#include "nn/losses.h"
#include "nn/models/code_correction.h"
#include "nn/models/identity_network.h"
#include "nn/models/reconstruction.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"

namespace code_correction_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

ModelConfig correcting_config() {
    ModelConfig config = tiny_model_config();
    config.encoder.identity_backbone = "small_conv";
    config.encoder.corrections = 2;
    return config;
}

/// A model whose corrections are steps of this length down the gradient of the images' error.
Model descending_model(ModelConfig config, double step) {
    Rng rng(1);
    Model model(config, rng);
    constexpr double gradient_scale = 300.0, inputs = 2.0 * code_size;
    const double weight = -step / gradient_scale * std::sqrt(inputs);
    Tensor matrix = Tensor::zeros({code_size, 2 * code_size});
    for (std::int64_t i = 0; i < code_size; ++i)
        matrix.mutable_values<float>()[static_cast<std::size_t>(i * (2 * code_size + 1))] =
            static_cast<float>(weight);
    for (const Parameter& parameter : model.parameters().all())
        if (parameter.name() == "encoder.corrector.preconditioner.weight")
            parameter.set_value(matrix);
    model.parameters().set_trainable("", false);
    return model;
}

/// Photos of another model's faces. The left half of the first is unknown.
FaceBatch photographed(const std::vector<Camera>& cameras) {
    const auto count = static_cast<std::int64_t>(cameras.size());
    const Model other = tiny_model(7);
    std::vector<Face> faces;
    for (std::int64_t i = 0; i < count; ++i) {
        const auto face = static_cast<std::size_t>(i);
        faces.emplace_back();
        faces.back().id = std::to_string(i);
        faces.back().image =
            render_view(other, random_codes(2, 8), i, cameras[face], {.samples_per_ray = 8}).image;
        faces.back().mask = Rng(9).uniform({16, 16, 1}, 0.0, 1.0);
    }
    faces.front().known = Tensor::full({16, 16, 1}, 1.0);
    for (std::size_t i = 0; i < 256; ++i)
        if (i % 16 < 8) faces.front().known.mutable_values<float>()[i] = 0.0F;
    FaceBatch batch = make_batch(faces, 16);
    batch.cameras = cameras;
    return batch;
}

double error_of_images(const Model& model, const FaceBatch& face, const Tensor& codes) {
    const Decoded decoded =
        model.decoder()(split_codes(codes), face.cameras, {.samples_per_ray = 12});
    const Variable rendered =
        where_known(known_at(face.known, 16, 16), decoded.images.front(), -1.0);
    return (mean(square(rendered - face.targets.front())) +
            opacity_loss(decoded.weights.transmittance, face.ray_mask, known_at(face.known, 8, 8)) *
                0.1)
        .value()
        .item();
}

double error_of_features(const Model& model, const FaceBatch& face, const Tensor& codes) {
    const Decoded decoded =
        model.decoder()(split_codes(codes), face.cameras, {.samples_per_ray = 12});
    const Variable rendered =
        where_known(known_at(face.known, 16, 16), decoded.images.front(), -1.0);
    const std::vector frame{ffhq_frame(face.cameras.front(), model.config().camera)};
    const auto embedding = [&](const Variable& image) {
        return model.encoder().face_embedding(augmented(image, frame));
    };
    const EncoderDistance distance(model.encoder());
    return (sum(distance.distance_to(rendered, distance.features(face.targets.front()))) * 0.3 -
            sum(embedding(rendered) * embedding(face.targets.front())) * 0.1)
        .value()
        .item();
}

}  // namespace

TEST_CASE("A corrector adds nothing before it learns, and then what its preconditioner says",
          "[correction]") {
    ParameterStore store;
    Rng rng(1);
    const CodeCorrector corrector(store, "c", 1, rng);
    const Variable codes = joined(random_codes(2, 3));
    const Tensor gradient = Rng(4).normal({2, code_size}, 0.0, 0.01);
    CHECK(identical(corrector(codes, {{gradient}}).value(), codes.value()));
    for (const Parameter& parameter : store.all())
        if (parameter.name() == "c.preconditioner.weight")
            parameter.set_value(Tensor::full({code_size, code_size}, 0.5));
    const Variable sums = sum(Variable(gradient), {1}) * (300.0 * 0.5 / std::sqrt(306.0));
    CHECK(check_close(corrector(codes, {{gradient}}).value(), (codes + sums).value(), 1e-4).passed);
    CHECK(error_message<ShapeError>([&] {
              static_cast<void>(corrector(codes, {{gradient, gradient}}));
          }) == "codes are corrected by 1 gradients, not 2");
}

TEST_CASE("The gradients that correct a code are those of both errors", "[correction]") {
    const Model model = descending_model(correcting_config(), 1.0);
    const FaceBatch face = photographed({model_camera(model, 0.2, 0.1, 0.0)});
    const Tensor codes = joined(random_codes(1, 5)).value();
    const std::vector<Tensor> gradients = CorrectionTarget(model, face, 0).gradients(codes);
    REQUIRE(gradients.size() == 2);
    const Tensor direction = Rng(6).normal({1, code_size}, 0.0, 1.0);
    constexpr double step = 1e-2;
    const auto moved = [&](double by) { return (Variable(codes) + direction * by).value(); };
    const auto derivative = [&](auto error) {
        return (error(model, face, moved(step)) - error(model, face, moved(-step))) / (2.0 * step);
    };
    const auto along = [&](const Tensor& gradient) {
        return sum(Variable(gradient) * direction).value().item();
    };
    // Samples that hardly count get no gradient, and these are differences in float32.
    CHECK(along(gradients[0]) == Approx(derivative(error_of_images)).epsilon(0.03));
    CHECK(along(gradients[1]) == Approx(derivative(error_of_features)).epsilon(0.03));
}

TEST_CASE("A backbone without activations is left out of the second error", "[correction]") {
    ModelConfig config = correcting_config();
    config.encoder.backbone = "mobilefacenet";
    const Model model = descending_model(config, 1.0);
    FaceBatch face = photographed({model_camera(model, 0.2, 0.1, 0.0)});
    const Tensor codes = joined(random_codes(1, 5)).value();
    const std::vector<Tensor> gradients = CorrectionTarget(model, face, 0).gradients(codes);
    REQUIRE(gradients.size() == 2);
    const Variable leaf = Variable::leaf(codes);
    const Decoded decoded = model.decoder()(split_codes(leaf), face.cameras,
                                            {.samples_per_ray = 12, .gradient_tolerance = 0.001});
    const std::vector frame{ffhq_frame(face.cameras.front(), model.config().camera)};
    const auto embedding = [&](const Variable& image) {
        return model.encoder().face_embedding(augmented(image, frame));
    };
    const Variable rendered =
        where_known(known_at(face.known, 16, 16), decoded.images.front(), -1.0);
    const Variable error = sum(embedding(rendered) * embedding(face.targets.front())) * -0.1;
    CHECK(check_close(gradients[1], grad(error, leaf).value(), 1e-4).passed);
}

TEST_CASE("Corrections bring faces nearer to their photos, whichever are beside them",
          "[correction]") {
    const Model model = descending_model(correcting_config(), 20.0);
    const std::vector<Camera> cameras{model_camera(model, 0.2, 0.1, 0.0),
                                      model_camera(model, -0.3, 0.0, 0.0)};
    const FaceBatch both = photographed(cameras);
    const Codes before = model.encoder()(Variable(both.input));
    const Codes after = corrected(model, both, before);
    CHECK(identical(joined(face_codes(model, both)).value(), joined(after).value()));
    const FaceBatch first = photographed({cameras.front()});
    const Codes alone = corrected(model, first, codes_of_face(before, 0));
    CHECK(check_close(joined(alone).value(), joined(codes_of_face(after, 0)).value(), 1e-5).passed);
    const auto error = [&](const Codes& codes) {
        return error_of_images(model, first, joined(codes).value());
    };
    CHECK(error(codes_of_face(after, 0)) < error(codes_of_face(before, 0)));
}

TEST_CASE("A face that the model cannot render keeps its codes", "[correction]") {
    ModelConfig config = correcting_config();
    config.decoder.depth_planes = "world_z";
    const Model model = descending_model(config, 20.0);
    FaceBatch face = photographed({model_camera(model, 0.1, 0.0, 0.0)});
    const Codes before = model.encoder()(Variable(face.input));
    CHECK_FALSE(identical(joined(corrected(model, face, before)).value(), joined(before).value()));
    face.cameras = {model_camera(model, 0.5 * std::numbers::pi, 0.0, 0.0)};
    CHECK(identical(joined(corrected(model, face, before)).value(), joined(before).value()));
}

}  // namespace code_correction_tests
