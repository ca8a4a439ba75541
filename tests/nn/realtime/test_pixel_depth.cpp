#include <catch2/catch.hpp>
#include <cmath>

#include "core/error.h"
#include "nn/realtime/pixel_depth.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace pixel_depth_tests {

Model model_with(std::int64_t rays_per_side) {
    ModelConfig config = tiny_model_config();
    const std::int64_t factor = rays_per_side / config.decoder.rays.rays_per_side;
    config.decoder.resolution *= factor;
    config.decoder.rays.rays_per_side = rays_per_side;
    Rng rng(1);
    return {config, rng};
}

TEST_CASE("the depth of each pixel is that of a decoder with a ray for each pixel", "[realtime]") {
    const Model model = model_with(8), fine = model_with(16);
    const Codes codes = random_codes(1, 1);
    for (const auto& [yaw, least_hits] : {std::pair{0.3, 1}, {0.0, 1}}) {
        const Camera camera = model_camera(model, yaw, -0.1, 0.05);
        FaceRenderer renderer(model, {.mode = RenderMode::exact, .depth = true});
        renderer.show(codes);
        const Tensor depth = pixel_depth(renderer, camera, 8, 16);
        const View expected = decoded_view(fine, codes, 0, camera, {.depth = true});
        REQUIRE(depth.shape() == Shape{16, 16, 1});
        int hits = 0, unequal = 0;
        for (std::size_t i = 0; i < 256; ++i) {
            const double opacity = expected.opacity.values<float>()[i];
            const double mixed = expected.depth.values<float>()[i];
            const double seen = depth.values<float>()[i];
            if (std::abs(opacity - 0.5) < 1e-4) continue;
            if (opacity < 0.5) {
                unequal += std::isinf(seen) && seen > 0.0 ? 0 : 1;
                continue;
            }
            ++hits;
            const double surface = (mixed - (1.0 - opacity) * expected.background_depth) / opacity;
            unequal += std::abs(seen - surface) < 1e-4 * surface ? 0 : 1;
        }
        CHECK(unequal == 0);
        CHECK(hits >= least_hits);
    }
}

TEST_CASE("a depth map that is no multiple of the rays is refused", "[realtime]") {
    const Model model = model_with(8);
    FaceRenderer renderer(model, {.mode = RenderMode::exact, .depth = true});
    renderer.show(random_codes(1, 1));
    const Camera camera = model_camera(model, 0.0, 0.0, 0.0);
    for (const std::int64_t side : {0, 4, 12})
        CHECK_THROWS_AS(pixel_depth(renderer, camera, 8, side), ValueError);
}

}  // namespace pixel_depth_tests
