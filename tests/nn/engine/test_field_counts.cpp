// Points through the field are counted wherever it is computed.
#include <catch2/catch.hpp>

#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "nn/realtime/face_renderer.h"
#include "support/tiny_model.h"

namespace field_count_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::int64_t rays = 64, samples = 4;

Variable decoded(const Model& model, const Codes& codes, DecodeOptions options) {
    options.samples_per_ray = samples;
    return sum(model.decoder()(codes, {model_camera(model, 0.0, 0.0, 0.0)}, options).images.back());
}

}  // namespace

TEST_CASE("the field's gradient costs its points once more unless its arguments are kept",
          "[work]") {
    const Model model = tiny_model();
    const Codes codes = random_codes(1, 1);
    const std::vector<Variable> weights = variables_of(model.parameters().trainable());
    for (const bool keep : {false, true}) {
        const WorkMeter meter;
        const Variable loss = decoded(model, codes, {.keep_field = keep});
        CHECK(meter.counts().field_points == rays * samples);
        static_cast<void>(grad(loss, weights));
        CHECK(meter.counts().field_points == (keep ? 1 : 2) * rays * samples);
    }
}

TEST_CASE("samples that are left out are not counted", "[work]") {
    const Model model = tiny_model();
    Tensor kept = Tensor::zeros({1, rays, samples});
    for (std::size_t i = 0; i < 10; ++i) kept.mutable_values<float>()[7 * i] = 1.0F;
    const WorkMeter meter;
    static_cast<void>(decoded(model, random_codes(1, 1), {.significant_samples = kept}));
    CHECK(meter.counts().field_points == 10);
}

TEST_CASE("a renderer's counts are those of the engine", "[work]") {
    const Model model = tiny_model();
    const Camera left = model_camera(model, -0.2, 0.0, 0.0),
                 right = model_camera(model, 0.2, 0.0, 0.0);
    for (const RenderMode mode : {RenderMode::exact, RenderMode::skip}) {
        FaceRenderer renderer(model, {.mode = mode, .samples_per_ray = samples});
        renderer.show(random_codes(1, 1));
        for (const Camera& camera : {left, right, left}) {
            const WorkMeter meter;
            static_cast<void>(renderer.render(camera));
            if (mode == RenderMode::exact) CHECK(renderer.counts().field_samples == rays * samples);
            CHECK(meter.counts().field_points >= renderer.counts().field_samples);
        }
        // By now both views are known, and nothing is learnt on the way.
        const WorkMeter meter;
        static_cast<void>(renderer.render(right));
        CHECK(meter.counts().field_points == renderer.counts().field_samples);
        CHECK(meter.counts().operations == 0);
        CHECK(meter.counts().buffers == 0);
        CHECK(renderer.counts().tiles > 0);
    }
}

}  // namespace field_count_tests
