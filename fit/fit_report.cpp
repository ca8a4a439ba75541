#include "fit/fit_report.h"

#include <cmath>
#include <numeric>

#include "core/io/image.h"
#include "core/median.h"
#include "core/metrics.h"
#include "core/ops/elementwise.h"
#include "core/ops/resample.h"
#include "core/ops/shape_ops.h"
#include "nn/known_pixels.h"
#include "nn/models/display_image.h"
#include "nn/realtime/view.h"

namespace stymo {

namespace {

/// `average` of each metric; it always gets at least one value.
template <class Average>
ImageMetrics averaged(const std::vector<ImageMetrics>& metrics, const Average& average) {
    ImageMetrics result;
    if (metrics.empty()) return result;
    for (double ImageMetrics::*member :
         {&ImageMetrics::l1, &ImageMetrics::l1_mean, &ImageMetrics::ssim, &ImageMetrics::psnr}) {
        std::vector<double> values;
        for (const ImageMetrics& one : metrics) values.push_back(one.*member);
        result.*member = average(values);
    }
    std::vector<double> distances;
    for (const ImageMetrics& one : metrics)
        if (one.lpips) distances.push_back(*one.lpips);
    if (!distances.empty()) result.lpips = average(distances);
    return result;
}

}  // namespace

MetricTarget::MetricTarget(const Tensor& target, const Tensor& mask, const Lpips* lpips,
                           const Tensor& known)
    : masked_target_(masked_image(target, where_known(known, mask, 0.0).value())),
      mask_(where_known(known, mask, 0.0).value()),
      known_(known),
      lpips_(lpips) {
    if (lpips_ != nullptr) features_ = lpips_->features(lpips_input(masked_target_));
}

ImageMetrics MetricTarget::measure(const Tensor& image) const {
    const Tensor& b = masked_target_;
    const Tensor a = masked_image(image, mask_);
    ImageMetrics metrics{l1_error(a, b), mean_absolute_error(a, b),
                         structural_similarity(a, b, known_), peak_signal_to_noise_ratio(a, b)};
    if (lpips_ != nullptr)
        metrics.lpips =
            lpips_->distance(lpips_->features(lpips_input(a)), features_).value().item();
    if (!known_.defined()) return metrics;
    // Unknown pixels are black in both images.
    const double share = known_share(known_);
    metrics.l1 /= share;
    metrics.l1_mean /= share;
    metrics.psnr += 10.0 * std::log10(share);
    if (metrics.lpips) *metrics.lpips /= share;
    return metrics;
}

Tensor lpips_input(const Tensor& image) {
    return affine(image.reshaped({1, image.shape(0), image.shape(1), 3}), 2.0, -1.0).value();
}

ImageMetrics mean(const std::vector<ImageMetrics>& metrics) {
    return averaged(metrics, [](const std::vector<double>& values) {
        return std::accumulate(values.begin(), values.end(), 0.0) /
               static_cast<double>(values.size());
    });
}

ImageMetrics median(const std::vector<ImageMetrics>& metrics) {
    return averaged(metrics, [](const std::vector<double>& values) { return median(values); });
}

JsonValue to_json(const ImageMetrics& metrics) {
    JsonValue json = JsonValue::object({{"l1", metrics.l1},
                                        {"l1_mean", metrics.l1_mean},
                                        {"ssim", metrics.ssim},
                                        {"psnr", metrics.psnr}});
    if (metrics.lpips) json.add("lpips", *metrics.lpips);
    return json;
}

namespace {

/// Whether row `index` has kept its codes and camera, as after a fit of no steps.
bool is_unchanged(const FaceBatch& target, const FitResult& result, std::int64_t index) {
    if (!result.losses.empty()) return false;
    const auto face = static_cast<std::size_t>(index);
    if (!(result.cameras[face] == target.cameras[face])) return false;
    for (std::size_t group = 0; group < code_names.size(); ++group) {
        const auto row = [&](const Codes& codes) {
            return slice(codes.groups[group], 0, index, index + 1).value().to_vector();
        };
        if (row(result.initial) != row(result.fitted)) return false;
    }
    return true;
}

MetricTarget metric_target(const FitReport& report, const FaceBatch& target, const Tensor& mask,
                           std::int64_t index, const Lpips* lpips) {
    const auto side = static_cast<int>(report.target.shape(0));
    const Tensor here =
        mask.shape(1) == side ? mask : resize_box(Variable(mask), side, side).value();
    return {report.target, display_mask(here, index), lpips, known_in(target, index)};
}

}  // namespace

Tensor known_in(const FaceBatch& target, std::int64_t index) {
    const Tensor known = target.known_of(index);
    if (!known.defined()) return known;
    const std::int64_t side = target.targets.back().shape(1);
    return known_at(known, side, side).reshaped({side, side, 1});
}

Tensor photo_with_guesses(const FaceBatch& target) {
    const Tensor& photos = target.targets.back();
    return display_image(
        with_guesses(known_at(target.known, photos.shape(1), photos.shape(2)), photos), 0);
}

FitReport report_fit(const Model& model, const FaceBatch& target, const Tensor& mask,
                     const FitResult& result, std::int64_t index, const Lpips* lpips,
                     bool with_head_mask) {
    const auto face = static_cast<std::size_t>(index);
    ViewOptions options{.samples_per_ray = model.config().reconstruction.fit_samples_per_ray,
                        .resolution = target.targets.back().shape(1)};
    FitReport report;
    report.target = display_image(target.targets.back(), index);
    const bool unchanged = is_unchanged(target, result, index);
    if (!unchanged)
        report.initial =
            render_view(model, result.initial, index, target.cameras[face], options).image;
    options.mask = with_head_mask && options.resolution == model.config().decoder.resolution;
    const View fitted = render_view(model, result.fitted, index, result.cameras[face], options);
    report.fitted = fitted.image;
    report.mask = fitted.mask;
    report.counting_samples = fitted.significant_samples;
    const MetricTarget measured = metric_target(report, target, mask, index, lpips);
    report.fitted_metrics = measured.measure(report.fitted);
    if (unchanged) {
        report.initial = report.fitted;
        report.initial_metrics = report.fitted_metrics;
    } else {
        report.initial_metrics = measured.measure(report.initial);
    }
    if (lpips != nullptr) report.lpips_network = lpips->label();
    return report;
}

void add_tuned(FitReport& report, const Model& tuned, const FaceBatch& target, const Tensor& mask,
               const FitResult& result, std::int64_t index, const Lpips* lpips) {
    const View view =
        render_view(tuned, result.fitted, index, result.cameras[static_cast<std::size_t>(index)],
                    {.samples_per_ray = tuned.config().reconstruction.fit_samples_per_ray,
                     .resolution = target.targets.back().shape(1),
                     .mask = report.mask.defined()});
    report.tuned = view.image;
    report.mask = view.mask;
    report.tuned_metrics = metric_target(report, target, mask, index, lpips).measure(report.tuned);
}

JsonValue to_json(const FitReport& report, const FitResult& result, double seconds) {
    JsonValue json = JsonValue::object(
        {{"initial", to_json(report.initial_metrics)}, {"fitted", to_json(report.fitted_metrics)}});
    if (report.tuned.defined()) json.add("tuned", to_json(report.tuned_metrics));
    if (!report.lpips_network.empty()) json.add("lpips_network", report.lpips_network);
    json.add("steps", result.losses.size());
    json.add("seconds", seconds);
    json.add("loss", result.losses);
    return json;
}

Tensor comparison_sheet(const FitReport& report) {
    std::vector<Tensor> tiles{report.target, report.initial, report.fitted};
    if (report.tuned.defined()) tiles.push_back(report.tuned);
    if (report.mask.defined())
        tiles.push_back(broadcast_to(Variable(report.mask), report.fitted.shape()).value());
    return tile_images(tiles, static_cast<int>(tiles.size()));
}

}  // namespace stymo
