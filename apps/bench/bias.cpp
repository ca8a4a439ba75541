#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "apps/bench/study.h"
#include "core/autograd/grad.h"
#include "core/ops/ops.h"
#include "fit/fit_report.h"
#include "nn/models/significant_rows.h"

namespace stymo {

namespace {

double inner_product(const Tensor& a, const Tensor& b) {
    return sum(Variable(a) * Variable(b)).value().item();
}

/// Differences between fitting with a tolerance and with every sample, over all faces. Gradients
/// are compared at the initial and at the fitted codes.
struct Bias {
    double samples = 0.0;  ///< share of them that is kept
    double cosine_mean = 0.0;
    double cosine_worst = 1.0;
    double distance_mean = 0.0;  ///< |difference| / |gradient with every sample|
    double distance_worst = 0.0;
    double psnr_mean = 0.0;        ///< dB against the photo
    double psnr_worst_loss = 0.0;  ///< largest loss of a face
};

/// One face with its photometric loss, fitted with every sample.
class FaceProblem {
public:
    FaceProblem(const BenchSubject& subject, std::size_t face, const BenchOptions& options)
        : model_(subject.model),
          batch_(make_batch(std::span(subject.photos).subspan(face, 1))),
          target_{batch_.input, batch_.targets, batch_.cameras},
          loss_(photometric(subject.model.config().reconstruction)),
          options_(options),
          exact_(fit(0.0)) {}

    /// Adds this face, one of `faces`.
    void add_to(Bias& bias, double tolerance, double faces) const {
        const double psnr = psnr_of(tolerance == 0.0 ? exact_ : fit(tolerance));
        bias.psnr_mean += psnr / faces;
        bias.psnr_worst_loss = std::max(bias.psnr_worst_loss, psnr_of(exact_) - psnr);
        for (const Codes& codes : {exact_.initial, exact_.fitted}) {
            const Tensor kept = significant_samples(
                model_.decoder().compositing_weights(codes, target_.cameras, options_.samples),
                tolerance);
            const Tensor every = gradient(codes, {}), some = gradient(codes, kept);
            const double length = std::sqrt(inner_product(every, every));
            const double cosine =
                inner_product(every, some) / (length * std::sqrt(inner_product(some, some)));
            const Tensor difference = (Variable(some) - Variable(every)).value();
            const double distance = std::sqrt(inner_product(difference, difference)) / length;
            bias.samples += 0.5 * mean(Variable(kept)).value().item() / faces;
            bias.cosine_mean += 0.5 * cosine / faces;
            bias.cosine_worst = std::min(bias.cosine_worst, cosine);
            bias.distance_mean += 0.5 * distance / faces;
            bias.distance_worst = std::max(bias.distance_worst, distance);
        }
    }

private:
    static ReconstructionConfig photometric(ReconstructionConfig config) {
        config.perceptual_weight = 0.0;
        return config;
    }
    [[nodiscard]] FitResult fit(double tolerance) const {
        return fit_codes(
            model_, loss_, target_,
            {.steps = options_.steps, .samples_per_ray = options_.samples, .tolerance = tolerance});
    }
    [[nodiscard]] double psnr_of(const FitResult& result) const {
        return report_fit(model_, target_, batch_.mask, result, 0).fitted_metrics.psnr;
    }
    /// With respect to all codes, in one row.
    [[nodiscard]] Tensor gradient(const Codes& at, const Tensor& significant) const {
        Codes codes;
        for (std::size_t i = 0; i < codes.groups.size(); ++i)
            codes.groups[i] = Variable::leaf(at.groups[i].value());
        const Decoded decoded = model_.decoder()(codes, target_.cameras,
                                                 {.samples_per_ray = options_.samples,
                                                  .resolution = target_.targets.back().shape(1),
                                                  .significant_samples = significant});
        const Variable total = loss_(decoded.images, loss_.target(target_.targets)).total;
        return concat(grad(total, {codes.groups.begin(), codes.groups.end()}), 1).value();
    }

    const Model& model_;
    FaceBatch batch_;
    FaceBatch target_;
    ReconstructionLoss loss_;
    const BenchOptions& options_;
    FitResult exact_;
};

void write_bias(Page& page, const StudyInputs& inputs) {
    const BenchSubject subject = make_subject(inputs.bench, inputs.seed);
    std::vector<FaceProblem> faces;
    for (std::size_t face = 0; face < subject.photos.size(); ++face)
        faces.emplace_back(subject, face, inputs.bench);
    std::vector<StudyRow> rows;
    for (const double tolerance : {0.0, 1e-4, 1e-3, 1e-2})
        rows.push_back({{tolerance}, [&faces, tolerance]() -> Row {
                            Bias bias;
                            for (const FaceProblem& face : faces)
                                face.add_to(bias, tolerance, static_cast<double>(faces.size()));
                            return {bias.samples,        bias.cosine_mean,    bias.cosine_worst,
                                    bias.distance_mean,  bias.distance_worst, bias.psnr_mean,
                                    bias.psnr_worst_loss};
                        }});
    page.add(run_study({.name = "bias",
                        .columns = {{"tolerance", "tolerance"},
                                    {"samples", "share of samples"},
                                    {"cosine_mean", "cosine", fixed<5>},
                                    {"cosine_worst", "worst", fixed<5>},
                                    {"distance_mean", "distance", fixed<4>},
                                    {"distance_worst", "worst", fixed<4>},
                                    {"psnr_mean_db", "PSNR dB", fixed<3>},
                                    {"psnr_worst_loss_db", "worst loss dB", fixed<3>}}},
                       rows));
}

}  // namespace

Study bias_study() {
    return {.name = "bias", .title = "Bias of a fit that leaves out samples", .write = write_bias};
}

}  // namespace stymo
