#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/ops/ops.h"
#include "core/parallel.h"
#include "nn/layers/render_block.h"
#include "nn/models/concatenated_field.h"
#include "nn/models/decoder.h"
#include "nn/models/radiance_field.h"
#include "nn/realtime/face_renderer.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/check_grad.h"
#include "support/error_message.h"
#include "support/live_nodes.h"
#include "support/thread_count.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// More samples than one tile takes.
struct Case {
    ParameterStore store;
    ConcatenatedField field;
    RayPoints rays;
    FieldStyle style;

    explicit Case(bool colors, std::int64_t samples = 9)
        : field(make(store, colors)),
          rays{Rng(5).uniform({2, 300 * samples, 3}, -1.0, 1.0, DType::float64),
               Rng(6).uniform({2, 300, samples}, 0.05, 0.4, DType::float64)},
          style{Rng(7).normal({2, 7}, 0.0, 0.5, DType::float64),
                Rng(8).normal({2, 5}, 0.0, 0.5, DType::float64)} {
        store.convert(DType::float64);
    }

    static ConcatenatedField make(ParameterStore& store, bool colors) {
        Rng rng(4);
        const FieldConfig config{.conditioning = Conditioning::concatenation,
                                 .frequencies = 2,
                                 .width = 10,
                                 .layers = 5,
                                 .channels = 3,
                                 .geometry_size = 7,
                                 .appearance_size = 5,
                                 .colors = colors};
        return {config, store, "field", rng};
    }

    void leave_out() {
        rays.significant = Rng(6).uniform(rays.deltas.shape(), 0.0, 1.0, DType::float64);
        std::int64_t i = 0;
        // The last rays of the first face keep none, over more than a tile.
        for (double& value : rays.significant.mutable_values<double>()) {
            value = value < 0.6 || (i >= 9 * 40 && i < 9 * 300) ? 0.0 : 1.0;
            ++i;
        }
    }
};

ModelConfig tiny_baseline(const std::string& render) {
    ModelConfig config = tiny_model_config();
    config.decoder.conditioning = "concatenation";
    config.decoder.render = render;
    config.decoder.mapping_layers = 0;
    return config;
}

Model make_model(const ModelConfig& config) {
    Rng rng(1);
    return {config, rng};
}

Variable loss_of(const RenderedFeatures& rendered) {
    return sum(square(rendered.features)) + sum(square(rendered.weights.weights)) +
           sum(rendered.weights.transmittance);
}

}  // namespace

TEST_CASE("samples that are left out of a field with concatenated codes count as empty space",
          "[field]") {
    for (const bool colors : {false, true}) {
        Case given(colors);
        given.leave_out();
        const RenderedFeatures result = given.field.render(given.rays, given.style, false);
        // The oracle: all densities, those left out multiplied by 0.
        const Variable density = reshape(given.field.density(given.rays.points, given.style),
                                         given.rays.deltas.shape()) *
                                 Variable(given.rays.significant);
        const CompositeWeights expected = composite_weights(density, given.rays.deltas);
        CHECK(check_close(result.weights.weights.value(), expected.weights.value(), 1e-12).passed);
        CHECK(
            check_close(result.weights.transmittance.value(), expected.transmittance.value(), 1e-12)
                .passed);
        given.rays.significant = Tensor::full(given.rays.deltas.shape(), 1.0, DType::float64);
        const Variable all_kept = given.field.render(given.rays, given.style, false).features;
        given.rays.significant = {};
        const Variable none_left_out = given.field.render(given.rays, given.style, false).features;
        CHECK(check_close(all_kept.value(), none_left_out.value(), 1e-12).passed);
    }
}

TEST_CASE(
    "a field with concatenated codes has the gradients of finite differences, to points and codes "
    "too",
    "[field]") {
    for (const bool colors : {false, true}) {
        Case given(colors, 3);
        given.rays.points = slice(Variable(given.rays.points), 1, 0, 12).value();
        given.rays.deltas = slice(Variable(given.rays.deltas), 1, 0, 4).value();
        given.store.set_trainable("", false);
        const auto function = [&](const std::vector<Variable>& x) {
            return loss_of(given.field.render_tracked(x[0], given.rays, {x[1], x[2]}));
        };
        const GradReport report = check_grad(
            "field", function,
            {given.rays.points, given.style.geometry.value(), given.style.appearance.value()},
            {.order = 1, .step = 1e-7, .tolerance = 1e-5});
        INFO(report.message);
        CHECK(report.passed);
    }
}

TEST_CASE(
    "what a field with concatenated codes keeps for the backward pass does not grow with its "
    "samples",
    "[field]") {
    const auto nodes = [](std::int64_t samples) {
        const Case given(false, samples);
        const LiveNodes live;
        const RenderedFeatures rendered = given.field.render(given.rays, given.style, false);
        return std::pair(live.added(), rendered.features.shape(2));
    };
    // Some for each of the tiles: two of them here, four there.
    CHECK(nodes(6).first < 60);
    CHECK(nodes(12).first < 80);
}

TEST_CASE("a field with concatenated codes gives the same bits on any number of threads",
          "[field]") {
    const ThreadCount restored;
    const Case given(false);
    std::vector<Tensor> results;
    for (const int threads : {1, 3}) {
        set_thread_count(threads);
        const RenderedFeatures rendered = given.field.render(given.rays, given.style, false);
        results.push_back(rendered.features.value());
        for (const Variable& gradient : grad(loss_of(rendered), variables_of(given.store.all())))
            results.push_back(gradient.value());
    }
    const std::size_t half = results.size() / 2;
    for (std::size_t i = 0; i < half; ++i) CHECK(identical(results[i], results[half + i]));
}

TEST_CASE(
    "HeadNeRF's field has HeadNeRF's number of multiply-adds, but for what is computed once for a "
    "face or a ray") {
    ParameterStore store;
    Rng rng(1);
    const ConcatenatedField field(
        {.conditioning = Conditioning::concatenation, .width = 384, .channels = 256}, store,
        "field", rng);
    constexpr std::int64_t of_codes = 2 * 384 * 179 + 192 * 127;
    CHECK(field.work().sample + field.work().ray + of_codes == 1'513'152);
    CHECK(field.work().ray == 192 * 256);
}

TEST_CASE("HeadNeRF's render blocks have HeadNeRF's number of multiply-adds") {
    ParameterStore store;
    Rng rng(1);
    std::int64_t total = 0, pixels = 32 * 32, in = 256;
    for (const std::int64_t out : {128, 64, 32, 32}) {
        total += pixels * PlainRenderBlock(store, std::to_string(pixels), in, out, in == 256, rng)
                              .multiply_adds();
        pixels *= 4;
        in = out;
    }
    constexpr double blurs = 0.141e9;
    CHECK(static_cast<double>(total) + blurs == Approx(3.534e9).epsilon(1e-3));
}

TEST_CASE(
    "a decoder without render blocks shows the colours of its rays, its smaller images shrunk, at "
    "every resolution") {
    ModelConfig config = tiny_baseline("none");
    config.decoder.resolution = 32;
    const Model model = make_model(config);
    CHECK(model.parameters().element_count("decoder.") ==
          model.parameters().element_count("decoder.field."));
    const Codes z = random_codes(2, 3);
    const std::vector<Camera> cameras(2, model_camera(model, 0.2, 0.0, 0.0));
    const Decoded whole = model.decoder()(z, cameras, {.samples_per_ray = 4, .mask = true});
    REQUIRE(whole.images.size() == 2);
    CHECK(whole.images[0].shape() == Shape{2, 16, 16, 3});
    CHECK(whole.images[1].shape() == Shape{2, 32, 32, 3});
    CHECK(whole.weights.weights.shape() == Shape{2, 1024, 4});
    CHECK(check_close(whole.images[0].value(), resize_box(whole.images[1], 16, 16).value(), 1e-6)
              .passed);
    const Tensor opacity = sum(whole.weights.weights, {2}).value().reshaped({2, 1024});
    CHECK(check_close(sigmoid(whole.mask_logit).value().reshaped({2, 1024}), opacity, 1e-4).passed);
    const Decoded part = model.decoder()(z, cameras, {.samples_per_ray = 4, .resolution = 16});
    REQUIRE(part.images.size() == 1);
    CHECK(part.images[0].shape() == Shape{2, 16, 16, 3});
    CHECK_FALSE(part.mask_logit.defined());
    CHECK(model.decoder().compositing_weights(z, cameras, 4, 16).shape() == Shape{2, 256, 4});
}

TEST_CASE(
    "every code group reaches the image of a decoder with concatenated codes, and W is Z without "
    "mapping layers") {
    for (const std::string render : {"blocks", "none"}) {
        ModelConfig config = tiny_baseline(render);
        config.decoder.field_width = 32;  // so that some ReLUs are open
        const Model model = make_model(config);
        Codes z = random_codes(1, 3);
        for (std::size_t group = 0; group < 4; ++group) {
            CHECK(identical(model.decoder().map(z).groups[group].value(), z.groups[group].value()));
            z.groups[group] = Variable::leaf(z.groups[group].value());
        }
        const Decoded decoded =
            model.decoder()(z, {model_camera(model, 0.0, 0.0, 0.0)}, {.samples_per_ray = 4});
        for (const Variable& gradient : grad(mean(square(decoded.images.back())), z.groups))
            CHECK(sum(abs(gradient)).value().item() > 0.0);
    }
}

TEST_CASE(
    "a model with concatenated codes is rendered in mode exact, with mask and depth, and refuses "
    "the others in one line") {
    for (const std::string render : {"blocks", "none"}) {
        const Model model = make_model(tiny_baseline(render));
        const Codes z = random_codes(1, 3);
        const Camera camera = model_camera(model, 0.3, 0.0, 0.0);
        FaceRenderer renderer(
            model, {.mode = RenderMode::exact, .samples_per_ray = 4, .mask = true, .depth = true});
        CHECK_THROWS_AS(renderer.render(camera), ValueError);
        renderer.show(z);
        const View view = renderer.render(camera);
        const View expected =
            decoded_view(model, z, 0, camera, {.samples_per_ray = 4, .mask = true, .depth = true});
        CHECK(identical(view.image, expected.image));
        CHECK(identical(view.mask, expected.mask));
        const std::int64_t side = render == "none" ? 16 : 8;
        CHECK(view.depth.shape() == Shape{side, side, 1});
        CHECK(view.mask.shape() == Shape{16, 16, 1});
        const std::string message = error_message<ValueError>(
            [&] { FaceRenderer(model, {.mode = RenderMode::skip, .samples_per_ray = 4}); });
        CHECK(is_one_line(message));
        CHECK_THAT(message, Catch::Contains("mode exact"));
    }
}

TEST_CASE(
    "choices of a decoder that exclude each other are refused in one line that names the keys") {
    const auto refusal = [](const auto& change) {
        ModelConfig config = tiny_baseline("none");
        change(config.decoder);
        return error_message<ConfigError>([&] { static_cast<void>(make_model(config)); });
    };
    CHECK_THAT(refusal([](DecoderConfig& c) { c.conditioning = "modulation"; }),
               Catch::Contains("decoder.render = none needs decoder.conditioning = concatenation"));
    CHECK_THAT(refusal([](DecoderConfig& c) { c.conditioning = "addition"; }),
               Catch::Contains("got addition"));
    CHECK_THAT(refusal([](DecoderConfig& c) { c.render = "rays"; }), Catch::Contains("got rays"));
    CHECK_THAT(refusal([](DecoderConfig& c) { c.mask_detach = true; }),
               Catch::Contains("decoder.mask_detach"));
}

TEST_CASE("a decoder with modulation is the modulated field and the render blocks, bit for bit") {
    DecoderConfig config = tiny_model_config().decoder;
    ParameterStore store, parts;
    Rng rng(1), same(1);
    const Decoder decoder(config, store, "decoder", rng);
    const RadianceField field({.frequencies = config.frequencies,
                               .width = config.field_width,
                               .layers = config.field_layers,
                               .feature_channels = config.feature_channels,
                               .style_size = 179},
                              parts, "decoder.field", same);
    const RenderBlock block(parts, "decoder.block16", config.feature_channels,
                            config.block_channels[0], 127, same);
    const Codes w = decoder.map(random_codes(1, 3));
    const std::vector<Camera> cameras{camera_from_pose(orbit_pose(0.2, 0.0, 0.0, 5.3), {})};
    const Decoded decoded = decoder(random_codes(1, 3), cameras, {.samples_per_ray = 4});
    const RenderedRays rays = field.render({decoded.samples.points, decoded.samples.deltas, {}},
                                           concat({w.identity(), w.expression()}, 1));
    const Variable features =
        field.apply_last_layer(rays.composited, sum(rays.weights.weights, {2}));
    const Rendered rendered =
        block({reshape(features, {1, 8, 8, 8}), {}}, concat({w.texture(), w.light()}, 1));
    CHECK(identical(decoded.feature_map.value().reshaped(features.shape()), features.value()));
    CHECK(identical(decoded.images[0].value(), tanh(rendered.rgb).value()));
}
