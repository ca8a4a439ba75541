#pragma once

#include "core/autograd/variable.h"

namespace stymo {

/// Densities are clamped to at most this value. Otherwise an infinite density times an empty
/// interval would be NaN, and sums of optical depths could overflow in float32.
inline constexpr double largest_density = 1e30;

struct CompositeWeights {
    Variable weights;        ///< (B, R, N): alpha_i t_i, equation (3)
    Variable transmittance;  ///< (B, R, 1): transmittance behind the last sample; the weights and
                             ///< it sum to 1
};

/// Throws ValueError, which names `function` and the first offending interval, if an element of
/// deltas (B, R, N) is negative (samples in reverse order) or NaN.
void require_ordered_samples(const char* function, const Tensor& deltas);

/// Equations (4) and (5): t_i = exp(-sum_{j<i} sigma_j delta_j), alpha_i = 1 - exp(-sigma_i
/// delta_i). density and deltas are (B, R, N) and >= 0. Results are finite even for infinite
/// densities. Throws ValueError for a negative interval.
[[nodiscard]] CompositeWeights composite_weights(const Variable& density, const Tensor& deltas);
/// Equation (3), sum_i weights_i features_i: (B, R, N) and (B, R * N, K) -> (B, R, K).
[[nodiscard]] Variable composite(const Variable& weights, const Variable& features);
/// Expected depth (B, R, 1): sum_i weights_i depth_i plus the transmittance times
/// `background_depth`.
[[nodiscard]] Variable composite_depth(const CompositeWeights& weights, const Tensor& depths,
                                       double background_depth);
/// Variance of the depth along each ray under its normalised weights, averaged over the rays: a
/// scalar, which is small if the density is a thin surface.
[[nodiscard]] Variable depth_variance(const Variable& weights, const Tensor& depths);

}  // namespace stymo
