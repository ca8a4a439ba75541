#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/matmul_precision.h"
#include "core/ops/elementwise.h"
#include "nn/engine/compositing.h"
#include "nn/engine/packed_field.h"
#include "nn/realtime/face_renderer.h"
#include "support/allocation_count.h"
#include "support/check_close.h"
#include "support/thread_count.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace {

/// With or without a layer that the encoding enters again, and with a width that fills no vector.
Model small_model(std::int64_t layers) {
    ModelConfig config = tiny_model_config();
    config.decoder.field_layers = layers;
    config.decoder.field_width = 20;
    config.decoder.frequencies = 3;
    Rng rng(1);
    return {config, rng};
}

/// Moves the densities of a whole model: softplus(output - 1) of a larger or smaller output.
void add_to_density(Model& model, double amount) {
    for (const Parameter& parameter : model.parameters().all()) {
        if (parameter.name() == "decoder.field.density.bias")
            parameter.set_value(Tensor::full({1}, amount));
    }
}

double mean_square_difference(const Tensor& a, const Tensor& b) {
    const std::vector<double> left = a.to_vector(), right = b.to_vector();
    double sum = 0.0;
    for (std::size_t i = 0; i < left.size(); ++i)
        sum += (left[i] - right[i]) * (left[i] - right[i]);
    return sum / static_cast<double>(left.size());
}

View rendered(const Model& model, const Codes& codes, const Camera& camera,
              const RendererOptions& options) {
    FaceRenderer renderer(model, options);
    renderer.show(codes);
    return renderer.render(camera);
}

}  // namespace

TEST_CASE("an exact frame is the decoder's, with mask and depth, for any depth of the field",
          "[realtime]") {
    for (const std::int64_t layers : {1, 2, 4, 5}) {
        const Model model = small_model(layers);
        const Codes codes = random_codes(2, 1);
        for (const std::int64_t samples : {2, 7, 64}) {
            INFO(layers << " layers, " << samples << " samples");
            const Camera camera = model_camera(model, 0.3, -0.1, 0.05);
            const View expected = decoded_view(
                model, codes, 1, camera, {.samples_per_ray = samples, .mask = true, .depth = true});
            FaceRenderer renderer(model, {.mode = RenderMode::exact,
                                          .samples_per_ray = samples,
                                          .mask = true,
                                          .depth = true});
            renderer.show(codes, 1);
            const View seen = renderer.render(camera);
            CHECK(check_close(seen.image, expected.image, 2e-5).passed);
            CHECK(check_close(seen.mask, expected.mask, 2e-5).passed);
            CHECK(check_close(seen.depth, expected.depth, 2e-5).passed);
            CHECK(renderer.counts().samples == 64 * samples);
            CHECK(renderer.counts().field_samples == 64 * samples);
        }
    }
}

TEST_CASE("an exact frame has the depths and the significant samples of training's forward pass",
          "[realtime]") {
    const Model model = small_model(5);
    const Codes codes = random_codes(1, 1);
    const Camera camera = model_camera(model, 0.3, -0.1, 0.05);
    const View expected = decoded_view(model, codes, 0, camera, {.depth = true});
    const View seen = rendered(model, codes, camera, {.mode = RenderMode::exact, .depth = true});
    CHECK(seen.significant_samples == expected.significant_samples);
    CHECK(check_close(seen.depth, expected.depth, 1e-6).passed);
    CHECK(check_close(seen.image, expected.image, 5e-6).passed);
}

TEST_CASE("skipping leaves nothing out at tolerance 0 and more and more as it grows",
          "[realtime]") {
    const Codes codes = random_codes(1, 2);
    // Of fog, whose rays are not surely opaque, less is left out than of a solid.
    for (const auto& [more_density, most_samples] : {std::pair{0.0, 64 * 48}, {10.0, 64 * 4}}) {
        Model model = small_model(4);
        add_to_density(model, more_density);
        const Camera camera = model_camera(model, -0.4, 0.1, 0.0);
        const View exact = rendered(model, codes, camera,
                                    {.mode = RenderMode::exact, .mask = true, .depth = true});
        double last_error = 0.0;
        std::int64_t last_samples = 64 * 64 + 1;
        for (const double tolerance : {0.0, 1e-3, 1e-2, 1e-1, 0.9}) {
            FaceRenderer renderer(model, {.tolerance = tolerance, .mask = true, .depth = true});
            renderer.show(codes);
            const View seen = renderer.render(camera);
            const double error = mean_square_difference(seen.image, exact.image);
            INFO("more density " << more_density << ", tolerance " << tolerance << ", error "
                                 << error << ", samples " << renderer.counts().field_samples);
            CHECK(renderer.counts().field_samples <= last_samples);
            CHECK(error >= last_error);
            CHECK(error < 0.02 * tolerance * tolerance + 1e-12);
            if (tolerance == 0.0) CHECK(check_close(seen.depth, exact.depth, 1e-6).passed);
            last_samples = renderer.counts().field_samples;
            last_error = error;
        }
        CHECK(last_samples < most_samples);
    }
}

TEST_CASE("products of medium precision cost an image little", "[realtime]") {
    const Codes codes = random_codes(1, 3);
    for (const bool emulated : {false, true}) {
        const Model model = small_model(5);
        const Camera camera = model_camera(model, 0.2, 0.1, 0.0);
        const View exact = rendered(model, codes, camera, {.mode = RenderMode::exact});
        const PrecisionScope lowered(MatmulPrecision::medium, emulated);
        for (const RenderMode mode : {RenderMode::exact, RenderMode::skip}) {
            const View seen = rendered(model, codes, camera, {.mode = mode, .tolerance = 1e-3});
            CHECK(-10.0 * std::log10(mean_square_difference(seen.image, exact.image)) > 50.0);
            CHECK(identical(seen.image, exact.image) ==
                  (computed_precision(MatmulPrecision::medium) == MatmulPrecision::highest &&
                   mode == RenderMode::exact));
        }
        // Render blocks of frames that leave out samples round operands, unless that is forbidden.
        const PrecisionScope of_tools(MatmulPrecision::high, emulated);
        const View of_skip = rendered(model, codes, camera, {.tolerance = 1e-3});
        CHECK(-10.0 * std::log10(mean_square_difference(of_skip.image, exact.image)) > 50.0);
    }
}

TEST_CASE("what a view shows does not depend on the views before it", "[realtime]") {
    const Model model = small_model(4);
    const Codes codes = random_codes(2, 4);
    const RendererOptions options{.samples_per_ray = 16, .tolerance = 0.05, .depth = true};
    FaceRenderer renderer(model, options);
    for (const double yaw : {-0.3, 0.0, 0.3}) {
        for (const std::int64_t face : {0, 1}) {
            renderer.show(codes, face);
            const View seen = renderer.render(model_camera(model, yaw, 0.0, 0.0));
            FaceRenderer fresh(model, options);
            fresh.show(codes, face);
            const View alone = fresh.render(model_camera(model, yaw, 0.0, 0.0));
            CHECK(identical(seen.image, alone.image));
            CHECK(identical(seen.depth, alone.depth));
        }
    }
}

TEST_CASE("a view that is kept does not change with the next one", "[realtime]") {
    const Model model = small_model(2);
    FaceRenderer renderer(model, {.mode = RenderMode::exact, .samples_per_ray = 4});
    renderer.show(random_codes(1, 5));
    const View first = renderer.render(model_camera(model, 0.0, 0.0, 0.0));
    const std::vector<double> before = first.image.to_vector();
    const View second = renderer.render(model_camera(model, 0.5, 0.0, 0.0));
    CHECK(first.image.to_vector() == before);
    CHECK_FALSE(identical(first.image, second.image));
}

TEST_CASE("nothing is allocated for a view whose surroundings have been seen", "[realtime]") {
#ifdef __clang__
    const ThreadCount restored;
    set_thread_count(1);  // LLVM's OpenMP allocates in every loop that threads share
#endif
    const Model model = small_model(4);
    const std::vector<Camera> cameras{model_camera(model, -0.2, 0.0, 0.0),
                                      model_camera(model, 0.2, 0.1, 0.0)};
    for (const RenderMode mode : {RenderMode::exact, RenderMode::skip}) {
        FaceRenderer renderer(model,
                              {.mode = mode, .samples_per_ray = 16, .mask = true, .depth = true});
        renderer.show(random_codes(1, 5));
        for (const Camera& camera : cameras) (void)renderer.render(camera);
        const std::int64_t before = allocation_count();
        for (const Camera& camera : cameras) (void)renderer.render(camera);
        CHECK(allocation_count() == before);
    }
}

TEST_CASE("layers are folded only for codes that have changed", "[realtime]") {
    const Model model = small_model(2);
    const Camera camera = model_camera(model, 0.0, 0.0, 0.0);
    const Codes codes = random_codes(2, 6);
    FaceRenderer renderer(model, {.samples_per_ray = 8});
    renderer.show(codes);
    const View first = renderer.render(camera);
    const std::int64_t folds = renderer.counts().folds;
    CHECK(renderer.counts().field_samples > 0);
    renderer.show(codes);
    const View again = renderer.render(camera);
    CHECK(renderer.counts().folds == folds);
    CHECK(renderer.counts().field_samples == 0);
    CHECK(identical(again.image, first.image));

    Codes edited = codes;
    edited.groups[2] = codes.groups[2] * 0.5;
    renderer.show(edited);
    CHECK(renderer.counts().folds == folds + 1);
    const View colored = renderer.render(camera);
    CHECK(renderer.counts().field_samples == 0);
    CHECK(renderer.counts().tiles == 0);
    CHECK(renderer.counts().layers_computed == 4);  // of one render block
    CHECK(renderer.counts().layers == 2 + 3 + 4 + 2);
    CHECK_FALSE(identical(colored.image, first.image));
    const View expected = rendered(model, edited, camera, {.samples_per_ray = 8});
    CHECK(identical(colored.image, expected.image));
}

TEST_CASE("where there is no density nothing goes through the field", "[realtime]") {
    Model model = small_model(4);
    add_to_density(model, -60.0);
    const Codes codes = random_codes(1, 7);
    const Camera camera = model_camera(model, 0.1, 0.0, 0.0);
    const View expected =
        decoded_view(model, codes, 0, camera, {.samples_per_ray = 8, .mask = true, .depth = true});
    for (const RenderMode mode : {RenderMode::exact, RenderMode::skip}) {
        FaceRenderer renderer(model,
                              {.mode = mode, .samples_per_ray = 8, .mask = true, .depth = true});
        renderer.show(codes);
        const View seen = renderer.render(camera);
        CHECK(check_close(seen.image, expected.image, 1e-5).passed);
        CHECK(check_close(seen.mask, expected.mask, 1e-5).passed);
        CHECK(check_close(seen.depth, expected.depth, 1e-5).passed);
        if (mode != RenderMode::skip) continue;
        CHECK(renderer.counts().field_samples == 0);
        CHECK(renderer.counts().tiles == 0);
        CHECK(renderer.counts().pixels_computed == 0);
        CHECK(renderer.counts().layers_computed == 0);
    }
}

TEST_CASE("behind an opaque front nothing goes through the field", "[realtime]") {
    Model model = small_model(2);
    add_to_density(model, 1e4);
    FaceRenderer renderer(model, {.samples_per_ray = 32});
    renderer.show(random_codes(1, 8));
    const View seen = renderer.render(model_camera(model, 0.0, 0.0, 0.0));
    CHECK(seen.image.all_finite());
    CHECK(renderer.counts().field_samples == 64);
}

TEST_CASE("a camera inside the head, or in front of it, sees what the decoder sees", "[realtime]") {
    const Model model = small_model(4);
    const Codes codes = random_codes(1, 9);
    for (const double distance : {0.2, 5.5}) {
        const Camera camera =
            camera_from_pose(orbit_pose(0.1, 0.2, 0.0, distance), model.config().camera.intrinsics);
        const View expected =
            decoded_view(model, codes, 0, camera, {.samples_per_ray = 16, .depth = true});
        const View exact =
            rendered(model, codes, camera,
                     {.mode = RenderMode::exact, .samples_per_ray = 16, .depth = true});
        CHECK(check_close(exact.image, expected.image, 2e-5).passed);
        CHECK(check_close(exact.depth, expected.depth, 2e-5).passed);
        const View skipped =
            rendered(model, codes, camera, {.samples_per_ray = 16, .tolerance = 1e-2});
        CHECK(mean_square_difference(skipped.image, expected.image) < 1e-4);
    }
}

TEST_CASE("a frame is the decoder's for a pivot behind the head's origin, too", "[realtime]") {
    ModelConfig config = tiny_model_config();
    config.camera.pivot_depth = -1.0;
    Rng rng(2);
    const Model model(config, rng);
    const Codes codes = random_codes(1, 6);
    FaceRenderer renderer(model, {.mode = RenderMode::exact, .samples_per_ray = 8});
    renderer.show(codes, 0);
    for (const double yaw : {0.0, 0.5}) {
        const Camera camera = model_camera(model, yaw, 0.0, 0.0);
        const View expected = decoded_view(model, codes, 0, camera, {.samples_per_ray = 8});
        CHECK(check_close(renderer.render(camera).image, expected.image, 1e-4).passed);
    }
}

TEST_CASE("codes that are refused leave nothing of themselves in later frames", "[realtime]") {
    const Model model = tiny_model(1).copy();
    const Camera camera = model_camera(model, 0.1, 0.0, 0.0);
    const Codes first = random_codes(1, 6), second = random_codes(1, 7);
    Codes broken = second;
    broken.groups[2] = Tensor::zeros({1, code_sizes[2] - 1});
    FaceRenderer renderer(model, {.mode = RenderMode::exact, .samples_per_ray = 8});
    FaceRenderer fresh(model, {.mode = RenderMode::exact, .samples_per_ray = 8});
    renderer.show(first, 0);
    CHECK_THROWS_AS(renderer.show(broken, 0), ShapeError);
    renderer.show(second, 0);
    fresh.show(second, 0);
    CHECK(renderer.render(camera).image.to_vector() == fresh.render(camera).image.to_vector());
}

TEST_CASE("the renderer refuses what it cannot render", "[realtime]") {
    const Model model = small_model(2);
    FaceRenderer renderer(model, {});
    CHECK_THROWS_WITH(renderer.render(model_camera(model, 0.0, 0.0, 0.0)),
                      Catch::Contains("show one first"));
    CHECK_THROWS_WITH(renderer.show(random_codes(2, 1), 2), Catch::Contains("face 2"));
    CHECK_THROWS_WITH(FaceRenderer(model, {.resolution = 24}), Catch::Contains("16, not 24"));
    CHECK_THROWS_AS(FaceRenderer(model, {.samples_per_ray = 1}), ValueError);
    CHECK_THROWS_AS(FaceRenderer(model, {.tolerance = 1.0}), ValueError);
    CHECK_THROWS_AS(FaceRenderer(model, {.tolerance = -0.1}), ValueError);
}

TEST_CASE("a frame that is stopped gives nothing, and the next one is what it would have been",
          "[realtime]") {
    const Model model = small_model(4);
    const Codes codes = random_codes(1, 1);
    const Camera camera = model_camera(model, 0.2, 0.0, 0.0);
    for (const RenderMode mode : {RenderMode::exact, RenderMode::skip}) {
        const View expected = rendered(model, codes, camera, {.mode = mode});
        FaceRenderer renderer(model, {.mode = mode});
        renderer.show(codes);
        std::stop_source stop;
        CHECK(renderer.render(camera, stop.get_token()).has_value());
        stop.request_stop();
        const Camera other = model_camera(model, -0.2, 0.0, 0.0);
        CHECK_FALSE(renderer.render(other, stop.get_token()).has_value());
        CHECK(check_close(renderer.render(camera).image, expected.image, 0.0).passed);
    }
}

TEST_CASE("depth alone runs no render block, and is that of the whole frame", "[realtime]") {
    const Model model = small_model(3);
    const Camera camera = model_camera(model, 0.2, 0.0, 0.0);
    FaceRenderer renderer(model, {.samples_per_ray = 8, .depth = true});
    renderer.show(random_codes(1, 3));
    const Tensor alone = renderer.render(camera, {}, FrameParts::field)->depth;
    CHECK(renderer.counts().pixels_computed == 0);
    CHECK(renderer.counts().field_samples > 0);
    const View whole = renderer.render(camera);
    CHECK(renderer.counts().field_samples == 0);  // the feature map is kept
    CHECK(renderer.counts().pixels_computed > 0);
    CHECK(identical(alone, whole.depth));
    CHECK(whole.opacity.shape() == whole.depth.shape());
}

TEST_CASE("a step of the tolerance keeps the density grid", "[realtime]") {
    const Model model = small_model(3);
    const Codes codes = random_codes(1, 3);
    const Camera camera = model_camera(model, 0.2, 0.0, 0.0);
    const RendererOptions options{.samples_per_ray = 8, .tolerance = 0.2};
    FaceRenderer renderer(model, options);
    renderer.show(codes);
    static_cast<void>(renderer.render(camera));
    CHECK(renderer.counts().grid_points > 0);
    renderer.set_tolerance(0.01);
    const View stepped = renderer.render(camera);
    CHECK(renderer.counts().grid_points == 0);
    RendererOptions finer = options;
    finer.tolerance = 0.01;
    CHECK(identical(stepped.image, rendered(model, codes, camera, finer).image));
    CHECK_THROWS_AS(renderer.set_tolerance(1.0), ValueError);
}
