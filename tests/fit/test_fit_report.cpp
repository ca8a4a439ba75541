#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/ops/ops.h"
#include "core/work_counts.h"
#include "fit/fit_report.h"
#include "nn/models/display_image.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/tiny_model.h"

namespace fit_report_tests {

using namespace stymo;
using namespace stymo::test;

namespace {

constexpr std::int64_t side = 16;

struct Fit {
    Model model = tiny_model(1);
    FaceBatch target;
    Tensor mask = Tensor::full({2, side, side, 1}, 1.0);
    FitResult result{random_codes(2, 1), random_codes(2, 2), {0.5, 0.25, 0.125}};

    Fit() {
        model.parameters().set_trainable("", false);
        target.cameras = {model_camera(model, -0.2, 0.0, 0.0), model_camera(model, 0.2, 0.0, 0.0)};
        result.cameras = target.cameras;
        // The second face was fitted perfectly.
        const Decoded decoded =
            model.decoder()(result.fitted, target.cameras,
                            {.samples_per_ray = model.config().reconstruction.fit_samples_per_ray});
        target.targets = {decoded.images.back().value()};
        target.targets[0].mutable_values<float>()[0] = 1.0F;
    }
};

}  // namespace

TEST_CASE("a report shows and measures one face before and after its fit", "[fit_report]") {
    const Fit fit;
    const FitReport report =
        report_fit(fit.model, fit.target, fit.mask, fit.result, 1, nullptr, true);
    CHECK(report.initial.shape() == Shape{side, side, 3});
    CHECK(report.mask.shape() == Shape{side, side, 1});
    CHECK(identical(report.target, display_image(fit.target.targets.back(), 1)));
    CHECK(check_close(report.fitted, report.target, 1e-5).passed);
    CHECK_FALSE(check_close(report.initial, report.target, 1e-3).passed);
    CHECK(report.fitted_metrics.l1 < 1e-5);
    CHECK(report.fitted_metrics.psnr > report.initial_metrics.psnr);
    const ImageMetrics expected =
        MetricTarget(report.target, Tensor::full({side, side, 1}, 1.0)).measure(report.initial);
    CHECK(report.initial_metrics.l1 == expected.l1);
    CHECK(report.initial_metrics.ssim == expected.ssim);
    // The first face's target has a pixel that its fit has not.
    CHECK(report_fit(fit.model, fit.target, fit.mask, fit.result, 0).fitted_metrics.l1 > 1e-5);
}

TEST_CASE(
    "a fit that changed nothing is rendered and measured once, and the head mask is computed only "
    "if it is wanted",
    "[fit_report][work]") {
    Fit fit;
    const auto counted = [&](bool with_head_mask) {
        const WorkMeter meter;
        const FitReport report =
            report_fit(fit.model, fit.target, fit.mask, fit.result, 1, nullptr, with_head_mask);
        CHECK(report.mask.defined() == with_head_mask);
        return meter.counts();
    };
    const std::int64_t two_frames = counted(false).field_points;
    CHECK(counted(true).operations > counted(false).operations);
    fit.result.losses.clear();
    CHECK(counted(false).field_points == two_frames);
    fit.result.initial = fit.result.fitted;
    CHECK(2 * counted(false).field_points == two_frames);
    const FitReport report = report_fit(fit.model, fit.target, fit.mask, fit.result, 1);
    CHECK(identical(report.initial, report.fitted));
    CHECK(report.initial_metrics.psnr == report.fitted_metrics.psnr);
}

TEST_CASE("only what the mask covers is measured", "[fit_report]") {
    Fit fit;
    fit.mask = Tensor::zeros({2, side, side, 1});
    const FitReport report = report_fit(fit.model, fit.target, fit.mask, fit.result, 0);
    CHECK(report.initial_metrics.l1 == 0.0);
    CHECK(report.fitted_metrics.l1 == 0.0);
}

TEST_CASE("a report as JSON has both scores, the number of steps and every loss", "[fit_report]") {
    const Fit fit;
    const FitReport report = report_fit(fit.model, fit.target, fit.mask, fit.result, 1);
    const nlohmann::json json = nlohmann::json::parse(to_json(report, fit.result, 1.5).text());
    CHECK(json["steps"] == 3);
    CHECK(json["seconds"] == 1.5);
    CHECK(json["loss"] == nlohmann::json{0.5, 0.25, 0.125});
    CHECK(json["initial"]["l1"] == report.initial_metrics.l1);
    CHECK(json["fitted"]["ssim"] == report.fitted_metrics.ssim);
}

TEST_CASE("a report names the network of LPIPS if it was measured", "[fit_report]") {
    const Fit fit;
    const Lpips lpips({.network = "vgg16", .trunk = "random", .heads = "random"}, "");
    const FitReport report = report_fit(fit.model, fit.target, fit.mask, fit.result, 1, &lpips);
    const nlohmann::json json = nlohmann::json::parse(to_json(report, fit.result, 1.5).text());
    CHECK(json["lpips_network"] == "vgg16, random weights");
    CHECK(json["initial"]["lpips"].get<double>() > json["fitted"]["lpips"].get<double>());
    const FitReport without = report_fit(fit.model, fit.target, fit.mask, fit.result, 1);
    CHECK_THAT(to_json(without, fit.result, 1.5).text(), !Catch::Contains("lpips"));
}

TEST_CASE("the comparison shows target, initial, fitted and mask side by side", "[fit_report]") {
    const Fit fit;
    const FitReport report =
        report_fit(fit.model, fit.target, fit.mask, fit.result, 0, nullptr, true);
    const Tensor sheet = comparison_sheet(report);
    REQUIRE(sheet.shape() == Shape{side, 4 * side, 3});
    const auto tile = [&](std::int64_t index) {
        return slice(Variable(sheet), 1, index * side, (index + 1) * side).value();
    };
    CHECK(identical(tile(0), report.target));
    CHECK(identical(tile(1), report.initial));
    CHECK(identical(tile(2), report.fitted));
    CHECK(identical(slice(Variable(tile(3)), 2, 1, 2).value(), report.mask));
}

}  // namespace fit_report_tests
