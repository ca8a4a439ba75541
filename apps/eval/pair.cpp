#include <iomanip>
#include <sstream>

#include "apps/common/face_input.h"
#include "apps/eval/commands.h"
#include "core/error.h"
#include "fit/fit_report.h"

namespace stymo {

namespace {

std::string text_of(const ImageMetrics& metrics, const std::vector<double>& terms,
                    const std::string& network) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(6);
    const auto line = [&text](const char* name, double value) {
        text << std::left << std::setw(12) << name << std::right << std::setw(10) << value << '\n';
    };
    line("L1", metrics.l1);
    line("L1 (mean)", metrics.l1_mean);
    line("SSIM", metrics.ssim);
    line("PSNR dB", metrics.psnr);
    if (metrics.lpips) {
        line("LPIPS", *metrics.lpips);
        for (std::size_t k = 0; k < terms.size(); ++k)
            line(("  term " + std::to_string(k)).c_str(), terms[k]);
        text << "network: " << network << '\n';
    }
    return text.str();
}

}  // namespace

AppResult compare_pair(const PairOptions& options) {
    std::optional<Lpips> lpips;
    if (!options.lpips.metric.empty())
        lpips.emplace(metric_config(options.lpips, {}), "leave out --lpips");
    const Tensor a = read_image_of_user(options.a);
    const Tensor b = read_image_of_user(options.b);
    if (!(a.shape() == b.shape()))
        fail<ShapeError>(options.b.string(), ": ", b.shape(1), " x ", b.shape(0), " pixels, but ",
                         options.a.string(), " has ", a.shape(1), " x ", a.shape(0));
    ImageMetrics metrics =
        MetricTarget(b, Tensor::full({b.shape(0), b.shape(1), 1}, 1.0)).measure(a);
    JsonValue json = to_json(metrics);
    std::vector<double> terms;
    if (lpips) {
        double total = 0.0;
        for (const Variable& term :
             lpips->terms(lpips->features(lpips_input(a)), lpips->features(lpips_input(b)))) {
            terms.push_back(term.value().item());
            total += terms.back();
        }
        metrics.lpips = total;
        json = to_json(metrics);
        json.add("lpips_terms", terms);
        json.add("lpips_network", lpips->label());
    }
    return {text_of(metrics, terms, lpips ? lpips->label() : ""), json};
}

}  // namespace stymo
