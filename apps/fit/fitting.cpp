#include "apps/fit/fitting.h"

#include <iomanip>
#include <sstream>

#include "core/metrics.h"

namespace stymo {

namespace {

/// The network that measures LPIPS: that of the loss, or the one of the command line, which is read
/// even if the fit does not use the term. Null without one.
const Lpips* metric_network(const LpipsOptions& options, const ReconstructionConfig& config,
                            const ReconstructionLoss& loss, std::optional<Lpips>& own) {
    if (loss.lpips() != nullptr) return loss.lpips();
    if (!options.trunk.empty())
        return &own.emplace(metric_config(options, config.perceptual), "leave out --lpips-trunk");
    return nullptr;
}

}  // namespace

Fitting::Fitting(const ModelOptions& model_options, const LpipsOptions& lpips_options,
                 FitJobOptions options)
    : mark(model_mark(model_options)),
      model(load_model(model_options)),
      config(fitting_config(lpips_options, model.config().reconstruction)),
      loss(config, "--perceptual-weight 0", model.has_encoder() ? &model.encoder() : nullptr),
      lpips(metric_network(lpips_options, config, loss, own_lpips)),
      job(model, loss, std::move(options)) {}

std::string Fitting::doubt_of(const FitReport& report) const {
    const double usual = model.validation_psnr().value_or(0.0);
    constexpr double far_below = 4.5;
    const double psnr =
        (report.tuned.defined() ? report.tuned_metrics : report.fitted_metrics).psnr;
    std::ostringstream text;
    text << std::fixed << std::setprecision(1) << "the PSNR is " << psnr << " dB";
    if (psnr > most_plausible_psnr) return text.str() + implausible_psnr;
    if (psnr >= usual - far_below) return {};
    text << ", far below what photos usually reach with this model (its first guesses of held-out "
            "photos: "
         << usual << " dB); look at fit.png and overlay.png";
    return text.str();
}

}  // namespace stymo
