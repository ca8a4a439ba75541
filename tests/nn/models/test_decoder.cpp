#include <catch2/catch.hpp>
#include <utility>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "nn/models/decoder.h"
#include "nn/models/radiance_field.h"
#include "nn/models/significant_rows.h"
#include "render/tracked_rays.h"
#include "support/check_close.h"
#include "support/check_grad.h"
#include "support/live_nodes.h"

namespace decoder_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

/// Few channels, but the paper's rays and resolutions.
DecoderConfig narrow(std::int64_t resolution) {
    DecoderConfig config;
    config.resolution = resolution;
    config.field_width = 12;
    config.field_layers = 4;
    config.feature_channels = 8;
    config.block_channels = {6, 5, 4, 4};
    config.mask_channels = 3;
    return config;
}

Codes random_codes(std::int64_t batch, DType dtype = DType::float32) {
    Rng rng(8);
    Codes codes;
    for (std::size_t i = 0; i < 4; ++i)
        codes.groups[i] = rng.normal({batch, code_sizes[i]}, 0.0, 1.0, dtype);
    return codes;
}

Camera frontal(double yaw = 0.0) {
    return camera_from_pose(orbit_pose(yaw, 0.0, 0.0, 5.3), {});
}

struct Model {
    ParameterStore store;
    Decoder decoder;
    explicit Model(const DecoderConfig& config) : decoder(make(store, config)) {}
    static Decoder make(ParameterStore& store, const DecoderConfig& config) {
        Rng rng(1);
        return {config, store, "decoder", rng};
    }
};

}  // namespace

TEST_CASE("the default decoder has the parameters of the paper's size table") {
    const Model model{DecoderConfig{}};
    const ParameterStore& store = model.store;
    CHECK(store.element_count("decoder.mapping.") == 109'104);
    CHECK(store.element_count("decoder.mask.") == 4'177);
    CHECK(store.element_count("decoder.block64.") == 362'115);
    CHECK(store.element_count("decoder.block128.") == 103'235);
    CHECK(store.element_count("decoder.block256.") == 32'163);
    CHECK(store.element_count("decoder.block512.") == 14'627);
    CHECK(store.element_count("decoder.field.") == 1'016'217);
    CHECK(store.element_count() == store.element_count("decoder."));
    CHECK(store.element_count() == 1'641'638);
}

TEST_CASE("a decoder renders every resolution of its model with any number of samples") {
    for (const std::int64_t resolution : {64, 128, 256, 512}) {
        const Model model(narrow(resolution));
        for (const std::int64_t samples : {2, 7, 32}) {
            if (resolution == 512 && samples != 7) continue;
            const Decoded decoded = model.decoder(random_codes(2), {frontal(), frontal(0.3)},
                                                  {.samples_per_ray = samples, .mask = true});
            REQUIRE(decoded.images.size() == static_cast<std::size_t>(resolution == 64    ? 1
                                                                      : resolution == 128 ? 2
                                                                      : resolution == 256 ? 3
                                                                                          : 4));
            std::int64_t side = 64;
            for (const Variable& image : decoded.images) {
                CHECK(image.shape() == Shape{2, side, side, 3});
                CHECK(image.value().all_finite());
                side *= 2;
            }
            CHECK(decoded.mask_logit.shape() == Shape{2, resolution, resolution, 1});
            CHECK(decoded.feature_map.shape() == Shape{2, 32, 32, 8});
            CHECK(decoded.weights.weights.shape() == Shape{2, 1024, samples});
        }
    }
}

TEST_CASE("a smaller resolution leaves the later blocks out and changes nothing else") {
    const Model model(narrow(256));
    const Decoded whole = model.decoder(random_codes(1), {frontal()}, {.samples_per_ray = 4});
    const Decoded part = model.decoder(random_codes(1), {frontal()},
                                       {.samples_per_ray = 4, .resolution = 128, .mask = true});
    REQUIRE(part.images.size() == 2);
    CHECK(identical(part.images[1].value(), whole.images[1].value()));
    CHECK(part.mask_logit.shape() == Shape{1, 128, 128, 1});
    CHECK_FALSE(whole.mask_logit.defined());
    CHECK_THROWS_WITH(model.decoder(random_codes(1), {frontal()}, {.resolution = 100}),
                      Catch::Contains("64, 128, 256, not 100"));
}

TEST_CASE("the mask loss shapes the render blocks, unless the mask branch is detached") {
    for (const bool detached : {false, true}) {
        DecoderConfig config = narrow(64);
        config.mask_detach = detached;
        const Model model(config);
        const Decoded decoded =
            model.decoder(random_codes(1), {frontal()}, {.samples_per_ray = 3, .mask = true});
        const std::vector<Parameter> parameters = model.store.all();
        std::vector<Variable> values;
        for (const Parameter& parameter : parameters) values.push_back(parameter.variable());
        const std::vector<Variable> gradients = grad(sum(decoded.mask_logit), values);
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            const std::string& name = parameters[i].name();
            const bool moved = sum(abs(gradients[i])).value().item() > 0.0;
            INFO(name << (detached ? ", detached" : ""));
            if (name.starts_with("decoder.mask.")) CHECK(moved);
            if (name == "decoder.block64.modulated1.weight") CHECK(moved == !detached);
            if (name.starts_with("decoder.field.") && detached) CHECK_FALSE(moved);
        }
    }
}

TEST_CASE("a feature map that is kept gives the same images") {
    const Model model(narrow(128));
    const Codes z = random_codes(2);
    const Decoded decoded =
        model.decoder(z, {frontal(), frontal(0.2)}, {.samples_per_ray = 5, .mask = true});
    const Decoded again =
        model.decoder.decode_feature_map(decoded.feature_map, model.decoder.map(z), {.mask = true});
    for (std::size_t i = 0; i < 2; ++i)
        CHECK(identical(again.images[i].value(), decoded.images[i].value()));
    CHECK(identical(again.mask_logit.value(), decoded.mask_logit.value()));
}

TEST_CASE("the density alone is what rendering composites") {
    const Model model(narrow(64));
    const Codes z = random_codes(1);
    const Decoded decoded = model.decoder(z, {frontal()}, {.samples_per_ray = 6});
    const Variable density = model.decoder.density(decoded.samples.points, model.decoder.map(z));
    CHECK(density.shape() == Shape{1, 6144, 1});
    const CompositeWeights weights =
        composite_weights(reshape(density, decoded.samples.deltas.shape()), decoded.samples.deltas);
    // Rendering goes ray tile by ray tile, so sums end elsewhere.
    CHECK(check_close(weights.weights.value(), decoded.weights.weights.value(), 1e-5).passed);
}

TEST_CASE("at the start every ray is partly opaque, so that gradients flow everywhere") {
    const Model model(narrow(64));
    const Decoded decoded = model.decoder(random_codes(1), {frontal()}, {});
    const double opacity = 1.0 - mean(decoded.weights.transmittance).value().item();
    CHECK(opacity > 0.5);
    CHECK(opacity < 0.99);
}

TEST_CASE("the last feature layer after compositing equals the same layer before it") {
    Rng rng(3);
    ParameterStore store;
    const RadianceField field(
        {.frequencies = 2, .width = 6, .layers = 4, .feature_channels = 5, .style_size = 3}, store,
        "field", rng);
    for (const Parameter& parameter : store.all()) {
        if (parameter.name() == "field.feature1.bias")
            parameter.set_value(rng.normal({5}, 0.0, 1.0));
    }
    store.convert(DType::float64);
    const Tensor r = rng.normal({2, 4 * 3, 6}, 0.0, 1.0, DType::float64);
    const Tensor weights = rng.uniform({2, 4, 3}, 0.0, 0.5, DType::float64);
    const Tensor ones = Tensor::full({2, 4 * 3, 1}, 1.0, DType::float64);
    const Variable before = composite(weights, field.apply_last_layer(r, ones));
    const Variable after =
        field.apply_last_layer(composite(weights, r), sum(Variable(weights), {2}));
    CHECK(check_close(after.value(), before.value(), 1e-13).passed);
}

TEST_CASE("float32 and float64 render the same image") {
    Model model(narrow(128));
    const Decoded single = model.decoder(random_codes(1), {frontal()}, {.samples_per_ray = 8});
    model.store.convert(DType::float64);
    Codes z = random_codes(1);
    for (Variable& group : z.groups) group = group.value().to(DType::float64);
    const Decoded precise = model.decoder(z, {frontal()}, {.samples_per_ray = 8});
    CHECK(precise.images[1].dtype() == DType::float64);
    CHECK(check_close(single.images[1].value().to(DType::float64), precise.images[1].value(), 1e-3)
              .passed);
}

TEST_CASE("recomputing the render blocks changes images and gradients by rounding at most") {
    Model model(narrow(128));
    struct Result {
        std::vector<Tensor> values;
        std::vector<Variable> gradients;
        std::int64_t nodes;
    };
    const auto result_of = [&](bool blocks) {
        Codes z = random_codes(2);
        std::vector<Variable> leaves;
        for (Variable& group : z.groups) leaves.push_back(group = Variable::leaf(group.value()));
        for (const Parameter& parameter : model.store.trainable())
            leaves.push_back(parameter.variable());
        const LiveNodes live;
        Rng jitter(5);
        const Decoded decoded = model.decoder(
            z, {frontal(), frontal(0.3)},
            {.samples_per_ray = 6, .mask = true, .recompute_blocks = blocks, .jitter = &jitter});
        const std::int64_t nodes = live.added();
        const Variable loss = mean(square(decoded.images[0])) + mean(square(decoded.images[1])) +
                              mean(decoded.mask_logit) +
                              depth_variance(decoded.weights.weights, decoded.samples.depths) +
                              mean(square(decoded.weights.transmittance));
        return Result{{decoded.images[0].value(), decoded.images[1].value(),
                       decoded.mask_logit.value(), decoded.weights.weights.value(),
                       decoded.weights.transmittance.value(), decoded.feature_map.value()},
                      grad(loss, leaves),
                      nodes};
    };
    const Result kept = result_of(false);
    const Result recomputed = result_of(true);
    CHECK(recomputed.nodes < kept.nodes);
    for (std::size_t i = 0; i < kept.values.size(); ++i)
        CHECK(check_close(recomputed.values[i], kept.values[i], 1e-6).passed);
    for (std::size_t i = 0; i < kept.gradients.size(); ++i) {
        const CloseReport report =
            check_close(recomputed.gradients[i].value(), kept.gradients[i].value(), 1e-5);
        INFO(report.message);
        CHECK(report.passed);
    }
}

TEST_CASE("a frozen decoder passes gradients to the codes without recording its weights") {
    Model model(narrow(64));
    model.store.set_trainable("", false);
    Codes z = random_codes(1);
    for (Variable& group : z.groups) group = Variable::leaf(group.value());
    const Variable loss =
        mean(square(model.decoder(z, {frontal()}, {.samples_per_ray = 4}).images[0]));
    for (const Variable& gradient : grad(loss, z.groups)) {
        CHECK(gradient.value().all_finite());
        CHECK(sum(abs(gradient)).value().item() > 0.0);
    }
    CHECK_FALSE(
        model.decoder(random_codes(1), {frontal()}, {.samples_per_ray = 4}).images[0].tracked());
}

TEST_CASE("poses are tracked at the samples that weigh more than the tolerance alone") {
    const Model model(narrow(64));
    const Codes codes = random_codes(1);
    const std::vector<Camera> cameras{frontal(0.2)};
    const auto decoded = [&](double tolerance, const Tensor& significant) {
        const Variable orbits = Variable::leaf(orbit_parameters(cameras, DType::float32));
        Decoded result = model.decoder(codes, cameras,
                                       {.samples_per_ray = 8,
                                        .significant_samples = significant,
                                        .gradient_tolerance = tolerance,
                                        .orbits = orbits});
        return std::pair{result.images.back().value(),
                         grad(sum(square(result.images.back())), orbits).value()};
    };
    constexpr double tolerance = 0.05;
    const auto [image, gradient] = decoded(tolerance, {});
    const auto [same_image, same_gradient] = decoded(
        0.0, significant_samples(model.decoder.compositing_weights(codes, cameras, 8), tolerance));
    CHECK(identical(image, same_image));
    CHECK(identical(gradient, same_gradient));
    CHECK(sum(abs(Variable(gradient))).value().item() > 0.0);
    CHECK_FALSE(identical(image, decoded(0.0, {}).first));
}

TEST_CASE("a decoder rejects wrong shapes and configurations") {
    const auto build = [](const DecoderConfig& config) {
        return Model(config).store.element_count();
    };
    DecoderConfig config = narrow(64);
    config.resolution = 96;
    CHECK_THROWS_WITH(build(config), Catch::Contains("decoder.resolution 96"));
    config = narrow(512);
    config.block_channels.resize(2);
    CHECK_THROWS_WITH(build(config),
                      Catch::Contains("needs 4 numbers in decoder.block_channels, got 2"));
    config = narrow(64);
    config.depth_planes = "spherical";
    CHECK_THROWS_AS(build(config), ConfigError);

    const Model model(narrow(64));
    CHECK_THROWS_AS(model.decoder(random_codes(2), {frontal()}, {}), ShapeError);
    Codes z = random_codes(1);
    z.groups[3] = Tensor::zeros({1, 26});
    CHECK_THROWS_WITH(model.decoder.map(z), Catch::Contains("code light must be (1, 27)"));
    CHECK_THROWS_AS(model.decoder(random_codes(1), {frontal()}, {.samples_per_ray = 1}),
                    ValueError);
}

TEST_CASE(
    "a decoder whose poses are tracked gives the same feature map, and its gradients are finite "
    "differences") {
    DecoderConfig config = narrow(16);
    config.frequencies = 2;
    config.rays.rays_per_side = 8;
    Model model{config};
    model.store.convert(DType::float64);
    model.store.set_trainable("", false);
    const std::vector<Pose> poses{orbit_pose(0.2, 0.1, 0.0, 5.3), orbit_pose(-0.3, 0.0, 0.1, 5.0)};
    std::vector<Camera> cameras;
    for (const Pose& pose : poses) cameras.push_back(camera_from_pose(pose, {}));
    const Codes codes = random_codes(2, DType::float64);
    const Tensor orbits = orbit_parameters(poses, DType::float64);
    for (const bool all : {true, false}) {
        DecodeOptions options{.samples_per_ray = 4};
        if (!all) {
            options.significant_samples = Tensor::full({2, 64, 4}, 1.0, DType::float64);
            const auto kept = options.significant_samples.mutable_values<double>();
            for (std::size_t i = 0; i < kept.size(); i += 3) kept[i] = 0.0;
        }
        const Tensor fused = model.decoder(codes, cameras, options).feature_map.value();
        // Of the feature map: the render blocks do not see the pose, and have kinks that a
        // difference would step over.
        const auto tracked = [&](const std::vector<Variable>& x) {
            options.orbits = x[0];
            return model.decoder(codes, cameras, options).feature_map;
        };
        CHECK(check_close(tracked({Variable(orbits)}).value(), fused, 1e-9).passed);
        const GradReport report = check_grad("decoder of orbits", tracked, {orbits}, {.order = 1});
        INFO(report.message);
        CHECK(report.passed);
    }
}

}  // namespace decoder_tests
