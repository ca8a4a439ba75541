#include "apps/bench/fit_bias.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <sstream>

#include "core/autograd/grad.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/ops/ops.h"
#include "core/progress.h"
#include "fit/fit_report.h"
#include "train/batch.h"

namespace stymo {

namespace {

constexpr std::array<double, 4> tolerances{0.0, 1e-4, 1e-3, 1e-2};

/// One face and its loss.
class FaceProblem {
public:
    FaceProblem(const BenchSubject& subject, std::size_t face, const BenchOptions& options)
        : model_(subject.model),
          batch_(make_batch(std::span(subject.photos).subspan(face, 1))),
          target_{batch_.input, batch_.targets, batch_.cameras},
          loss_(photometric(subject.model.config().reconstruction)),
          samples_(options.samples),
          steps_(options.steps) {}

    [[nodiscard]] FitResult fit(double tolerance) const {
        return fit_codes(model_, loss_, target_, {.steps = steps_, .samples_per_ray = samples_, .tolerance = tolerance});
    }
    [[nodiscard]] double psnr(const FitResult& result) const {
        return report_fit(model_, target_, batch_.mask, result, 0).fitted_metrics.psnr;
    }
    [[nodiscard]] Tensor weights(const Codes& codes) const {
        return model_.decoder().compositing_weights(codes, target_.cameras, samples_);
    }
    /// All codes' in one row.
    [[nodiscard]] Tensor gradient(const Codes& at, const Tensor& kept_samples) const {
        Codes codes;
        for (std::size_t i = 0; i < codes.groups.size(); ++i) codes.groups[i] = Variable::leaf(at.groups[i].value());
        const Decoded decoded = model_.decoder()(
            codes, target_.cameras,
            {.samples_per_ray = samples_, .resolution = target_.targets.back().shape(1), .kept_samples = kept_samples});
        const Variable total = loss_(decoded.images, loss_.target(target_.targets)).total;
        return concat(grad(total, {codes.groups.begin(), codes.groups.end()}), 1).value();
    }

private:
    static ReconstructionConfig photometric(ReconstructionConfig config) {
        config.perceptual_weight = 0.0;
        return config;
    }

    const Model& model_;
    TrainingBatch batch_;
    FitTarget target_;
    ReconstructionLoss loss_;
    std::int64_t samples_;
    std::int64_t steps_;
};

double inner_product(const Tensor& a, const Tensor& b) {
    return sum(Variable(a) * Variable(b)).value().item();
}

/// Adds what one face says about all tolerances.
void add_face(std::vector<FitBias>& rows, const FaceProblem& problem, double part) {
    double psnr_of_all = 0.0;
    std::array<FitResult, tolerances.size()> fits;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (interrupted()) fail<Error>("interrupted; nothing was written");
        fits[i] = problem.fit(rows[i].tolerance);
        const double psnr = problem.psnr(fits[i]);
        if (i == 0) psnr_of_all = psnr;
        rows[i].psnr_mean += part * psnr;
        rows[i].psnr_worst_loss = std::max(rows[i].psnr_worst_loss, psnr_of_all - psnr);
    }
    for (const Codes& codes : {fits[0].initial, fits[0].fitted}) {
        const Tensor exact = problem.gradient(codes, {});
        const Tensor weights = problem.weights(codes);
        for (FitBias& row : rows) {
            const Tensor kept = significant_samples(weights, row.tolerance);
            const Tensor biased = problem.gradient(codes, kept);
            const double length = std::sqrt(inner_product(exact, exact));
            const double cosine = inner_product(exact, biased) / (length * std::sqrt(inner_product(biased, biased)));
            const Tensor difference = (Variable(biased) - Variable(exact)).value();
            const double distance = std::sqrt(inner_product(difference, difference)) / length;
            row.samples += 0.5 * part * mean(Variable(kept)).value().item();
            row.cosine_mean += 0.5 * part * cosine;
            row.cosine_worst = std::min(row.cosine_worst, cosine);
            row.distance_mean += 0.5 * part * distance;
            row.distance_worst = std::max(row.distance_worst, distance);
        }
    }
}

std::string short_number(double value) {
    std::ostringstream text;
    text << value;
    return text.str();
}

}  // namespace

std::vector<FitBias> measure_fit_bias(const BenchSubject& subject, const BenchOptions& options) {
    const InterruptGuard guard;
    std::vector<FitBias> rows;
    for (const double tolerance : tolerances) rows.push_back({.tolerance = tolerance, .samples = 0.0, .cosine_mean = 0.0});
    Progress progress({.title = "bias", .total = std::ssize(subject.photos), .unit = "faces"});
    for (std::size_t face = 0; face < subject.photos.size(); ++face) {
        add_face(rows, FaceProblem(subject, face, options), 1.0 / static_cast<double>(subject.photos.size()));
        progress.update(static_cast<std::int64_t>(face) + 1);
    }
    progress.finish();
    return rows;
}

Cells fit_bias_cells(const std::vector<FitBias>& rows) {
    Cells cells{{"tolerance", "samples", "cosine", "worst", "distance", "worst", "PSNR dB", "worst loss dB"}};
    for (const FitBias& row : rows) {
        cells.push_back({short_number(row.tolerance), decimal(100.0 * row.samples, 1) + " %", decimal(row.cosine_mean, 5),
                         decimal(row.cosine_worst, 5), decimal(row.distance_mean, 4), decimal(row.distance_worst, 4),
                         decimal(row.psnr_mean, 3), decimal(row.psnr_worst_loss, 3)});
    }
    return cells;
}

JsonValue to_json(const std::vector<FitBias>& rows) {
    std::vector<JsonValue> json;
    for (const FitBias& row : rows) {
        json.push_back(JsonValue::object({{"tolerance", row.tolerance},
                                          {"samples", row.samples},
                                          {"cosine_mean", row.cosine_mean},
                                          {"cosine_worst", row.cosine_worst},
                                          {"distance_mean", row.distance_mean},
                                          {"distance_worst", row.distance_worst},
                                          {"psnr_mean_db", row.psnr_mean},
                                          {"psnr_worst_loss_db", row.psnr_worst_loss}}));
    }
    return json;
}

}  // namespace stymo
