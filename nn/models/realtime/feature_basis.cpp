#include "nn/models/realtime/feature_basis.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/kernels/matmul.h"
#include "core/rng.h"

namespace stymo {
namespace {

constexpr int iterations = 12;

/// Makes the rows orthonormal, first to last; a row without a part of its own becomes zero.
void orthonormalise(Tensor& rows) {
    const std::int64_t count = rows.shape(0), channels = rows.shape(1);
    float* values = rows.mutable_values<float>().data();
    const auto product = [channels](const float* a, const float* b) {
        double sum = 0.0;
        for (std::int64_t c = 0; c < channels; ++c) sum += static_cast<double>(a[c]) * static_cast<double>(b[c]);
        return sum;
    };
    for (std::int64_t i = 0; i < count; ++i) {
        float* row = values + i * channels;
        const double before = std::sqrt(product(row, row));
        // Twice, because rounding in the first pass leaves a part along the earlier rows.
        for (int pass = 0; pass < 2; ++pass) {
            for (std::int64_t j = 0; j < i; ++j) {
                const float* earlier = values + j * channels;
                const auto part = static_cast<float>(product(row, earlier));
                for (std::int64_t c = 0; c < channels; ++c) row[c] -= part * earlier[c];
            }
        }
        const double own = std::sqrt(product(row, row));
        const float scale = own > 1e-6 * before ? static_cast<float>(1.0 / own) : 0.0F;
        for (std::int64_t c = 0; c < channels; ++c) row[c] *= scale;
    }
}

Tensor weighted_mean(const Tensor& features, const Tensor& weights) {
    const std::int64_t channels = features.shape(1);
    const auto values = features.values<float>();
    const auto weight = weights.values<float>();
    std::vector<double> sums(static_cast<std::size_t>(channels));
    double total = 0.0;
    for (std::size_t row = 0; row < weight.size(); ++row) {
        total += static_cast<double>(weight[row]);
        for (std::size_t c = 0; c < sums.size(); ++c)
            sums[c] += static_cast<double>(weight[row]) * static_cast<double>(values[row * sums.size() + c]);
    }
    for (double& sum : sums) sum = total > 0.0 ? sum / total : 0.0;
    return Tensor::from({channels}, sums).to(DType::float32);
}

}  // namespace

FeatureBasis principal_plane(const Tensor& features, const Tensor& weights, std::int64_t dimension) {
    const std::int64_t rows = features.shape(0), channels = features.shape(1);
    FeatureBasis basis{weighted_mean(features, weights), {}};
    Tensor deviations(features.shape());
    {
        const auto values = features.values<float>();
        const auto mean = basis.mean.values<float>();
        const auto weight = weights.values<float>();
        const auto out = deviations.mutable_values<float>();
        for (std::size_t i = 0; i < out.size(); ++i)
            out[i] = (values[i] - mean[i % mean.size()]) * std::sqrt(weight[i / mean.size()]);
    }
    const Tensor centred = deviations.reshaped({1, rows, channels});
    const Tensor covariance = kernels::matmul(centred, centred, {.transpose_a = true});
    Rng rng(0);
    basis.directions = rng.normal({dimension, channels}, 0.0, 1.0);
    orthonormalise(basis.directions);
    for (int i = 0; i < iterations; ++i) {
        basis.directions =
            kernels::matmul(basis.directions.reshaped({1, dimension, channels}), covariance, {}).reshaped({dimension, channels});
        orthonormalise(basis.directions);
    }
    return basis;
}

}  // namespace stymo
