#include "fit/fit_report.h"

#include "core/io/image.h"
#include "core/ops/shape_ops.h"
#include "nn/models/picture.h"
#include "nn/models/view.h"

namespace stymo {

FitReport report_fit(const Model& model, const FitTarget& target, const Tensor& mask, const FitResult& result,
                     std::int64_t index) {
    const Camera& camera = target.cameras[static_cast<std::size_t>(index)];
    ViewOptions options{.samples_per_ray = model.config().reconstruction.fit_samples_per_ray};
    FitReport report;
    report.target = picture(target.targets.back(), index);
    report.initial = render_view(model, result.initial, index, camera, options).picture;
    options.mask = true;
    const View fitted = render_view(model, result.fitted, index, camera, options);
    report.fitted = fitted.picture;
    report.mask = fitted.mask;
    const Tensor head = picture_mask(mask, index);
    report.initial_metrics = measure(report.initial, report.target, head);
    report.fitted_metrics = measure(report.fitted, report.target, head);
    return report;
}

JsonValue to_json(const FitReport& report, const FitResult& result, double seconds) {
    return JsonValue::object({{"initial", to_json(report.initial_metrics)},
                              {"fitted", to_json(report.fitted_metrics)},
                              {"steps", result.losses.size()},
                              {"seconds", seconds},
                              {"loss", result.losses}});
}

Tensor comparison_sheet(const FitReport& report) {
    const Tensor mask = broadcast_to(Variable(report.mask), report.fitted.shape()).value();
    return tile_images({report.target, report.initial, report.fitted, mask}, 4);
}

}  // namespace stymo
