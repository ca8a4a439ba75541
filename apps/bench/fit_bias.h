#pragma once

#include <vector>

#include "apps/bench/report.h"
#include "apps/bench/subject.h"

namespace stymo {

/// A fit that leaves out samples of less compositing weight than a tolerance, beside one with every sample.
struct FitBias {
    double tolerance = 0.0;
    double samples = 1.0;  ///< share of them that counts in the gradients that are compared
    // Of the photometric loss to the codes, against that with every sample; over faces, at their initial and their fitted codes.
    double cosine_mean = 1.0;
    double cosine_worst = 1.0;
    double distance_mean = 0.0;  ///< |difference| / |gradient with every sample|
    double distance_worst = 0.0;
    // Of a fit with `BenchOptions::steps` steps, in the picture of the fitted codes with every sample; over faces.
    double psnr_mean = 0.0;        ///< dB against the photo
    double psnr_worst_loss = 0.0;  ///< the most that a face has less than with every sample
};

/// For several tolerances; the first one is 0. The loss is photometric.
[[nodiscard]] std::vector<FitBias> measure_fit_bias(const BenchSubject& subject, const BenchOptions& options);
[[nodiscard]] Cells fit_bias_cells(const std::vector<FitBias>& rows);
[[nodiscard]] JsonValue to_json(const std::vector<FitBias>& rows);

}  // namespace stymo
