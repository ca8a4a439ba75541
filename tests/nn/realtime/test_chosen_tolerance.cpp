#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "core/matmul_precision.h"
#include "nn/realtime/chosen_tolerance.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/tiny_model.h"

using namespace stymo;
using namespace stymo::test;

namespace chosen_tolerance_tests {

namespace {

Model shipped_model() {
    return Model::load(
        std::filesystem::path(STYMO_SOURCE_DIR) / "configs/models/faces-256/model.safetensors",
        ModelParts::decoder);
}

/// A face on a path from -40 to 40 degrees.
std::vector<FaceView> path(const Model& model, const Codes& codes, int count) {
    std::vector<FaceView> views;
    for (int i = 0; i < count; ++i) {
        const double part = count == 1 ? 0.0 : 2.0 * i / (count - 1) - 1.0;
        views.push_back({codes, model_camera(model, 40.0 * part * std::numbers::pi / 180.0,
                                             0.14 * (i % 3 - 1), 0.0)});
    }
    return views;
}

FrameError error_on(FaceRenderer& renderer, FaceRenderer& exact, std::span<const FaceView> views) {
    FrameError error;
    for (const FaceView& view : views) {
        renderer.show(view.codes);
        exact.show(view.codes);
        error.add(renderer.render(view.camera).image, exact.render(view.camera).image);
    }
    return error;
}

}  // namespace

TEST_CASE("the model that ships keeps 45 dB and its outline in the worst view of a path",
          "[realtime]") {
    const PrecisionScope of_tools(MatmulPrecision::high);
    const Model model = shipped_model();
    Rng rng(1);
    const std::vector<FaceView> views =
        path(model, model.code_statistics()->sample(rng, 1.0), views_per_check);
    std::vector<FaceView> some;
    for (std::size_t i = 0; i < views.size(); i += 3) some.push_back(views[i]);
    FaceRenderer exact(model, {.mode = RenderMode::exact, .remove_floaters = true});
    for (const RenderModeTraits& mode : render_modes()) {
        if (!mode.tolerates) continue;
        ChosenRenderer chosen =
            choose_renderer(model, views, {.mode = mode.mode, .remove_floaters = true}, 45.0);
        const FrameError error = error_on(chosen.renderer, exact, some);
        INFO(mode.name << ", tolerance " << chosen.tolerance << ": " << error.worst_psnr
                       << " dB, pixel " << error.worst_pixel);
        CHECK(chosen.mode == mode.mode);
        CHECK(error.worst_psnr > 45.0);
        CHECK(error.worst_pixel < 0.15);
    }
}

TEST_CASE("from far away the model that ships shows one head, the same in every mode",
          "[realtime]") {
    const Model model = shipped_model();
    const CameraConfig& config = model.config().camera;
    Rng rng(1);
    const Codes codes = model.code_statistics()->sample(rng, 1.0);
    const std::vector<FaceView> far{
        {codes,
         camera_from_pose(pivot_pose(0.0, 0.0, 0.0, 4.0 * config.distance, config.pivot_depth),
                          config.intrinsics)}};
    FaceRenderer exact(model, {.mode = RenderMode::exact, .depth = true}), fast(model, {});
    const FrameError error = error_on(fast, exact, far);
    CHECK(error.worst_psnr > 40.0);
    // Without the bound, further heads surround the one in the middle half.
    const View seen = exact.render(far.front().camera);
    const std::int64_t side = seen.opacity.shape(0);
    const std::span<const float> opacity = seen.opacity.values<float>();
    float beside = 0.0F, middle = 0.0F;
    for (std::int64_t i = 0; i < side * side; ++i) {
        const bool central = 4 * (i / side) >= side && 4 * (i / side) < 3 * side &&
                             4 * (i % side) >= side && 4 * (i % side) < 3 * side;
        float& most = central ? middle : beside;
        most = std::max(most, opacity[static_cast<std::size_t>(i)]);
    }
    CHECK(middle > 0.99F);
    CHECK(beside == 0.0F);
}

TEST_CASE("one picture costs fewer evaluations of the field than an exact one", "[realtime]") {
    const Model model = shipped_model();
    Rng rng(2);
    FaceRenderer renderer(model, {});
    renderer.show(model.code_statistics()->sample(rng, 1.0));
    static_cast<void>(renderer.render(model_camera(model, 0.3, 0.0, 0.0)));
    const RenderCounts& counts = renderer.counts();
    CHECK(counts.grid_points > 0);
    CHECK(counts.grid_points + counts.field_samples < counts.samples);
}

TEST_CASE("a choice costs little, and few views are rendered exactly without one", "[realtime]") {
    const Model model = tiny_model();
    const Codes codes = random_codes(1, 1);
    const RendererOptions options{.samples_per_ray = 8};
    for (const std::int64_t count : {16, 48, 400}) {
        for (const double psnr : {20.0, 45.0, 90.0}) {
            const std::vector<FaceView> views = path(model, codes, static_cast<int>(count));
            ChosenRenderer chosen = choose_renderer(model, views, options, psnr);
            CHECK(16 * chosen.exact_frames <= count);
            CHECK(4 * chosen.fast_frames <= count);
            if (chosen.mode == RenderMode::exact) continue;
            CHECK(chosen.error.views == chosen.exact_frames);
            CHECK(chosen.error.worst_psnr >= psnr + spare_decibels);
            CHECK(chosen.error.worst_pixel <= largest_pixel_error * std::exp2((45.0 - psnr) / 6.0));
        }
    }
    for (const RenderMode mode : {RenderMode::skip, RenderMode::exact}) {
        const std::vector<FaceView> few = path(model, codes, mode == RenderMode::exact ? 48 : 15);
        RendererOptions wanted = options;
        wanted.mode = mode;
        const ChosenRenderer chosen = choose_renderer(model, few, wanted, 45.0);
        CHECK(chosen.mode == RenderMode::exact);
        CHECK(chosen.exact_frames == 0);
    }
}

TEST_CASE("a frame error has the worst view and the worst pixel", "[realtime]") {
    FrameError error;
    const Tensor black = Tensor::zeros({4, 4, 3});
    error.add(black, black);
    CHECK(error.worst_psnr == 100.0);
    error.add(Tensor::full({4, 4, 3}, 0.1), black);
    CHECK(error.worst_psnr == Approx(20.0).margin(1e-4));
    CHECK(error.worst_pixel == Approx(0.1));
    CHECK(error.views == 2);
}

}  // namespace chosen_tolerance_tests
