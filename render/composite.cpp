#include "render/composite.h"

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/error.h"
#include "core/ops/ops.h"

namespace stymo {
namespace {

// Rays of smaller opacity have no surface and do not count.
constexpr double least_opacity = 1e-3;

void require_same(const char* function, const Shape& left, const Shape& right) {
    if (left.rank() != 3 || !(left == right))
        fail<ShapeError>("[", function,
                         "] expected two tensors of one shape (cameras, rays, samples), got ", left,
                         " and ", right);
}

}  // namespace

void require_ordered_samples(const char* function, const Tensor& deltas) {
    dispatch(deltas.dtype(), [&]<class T>(T) {
        const std::span<const T> values = deltas.values<T>();
        const auto refused = std::ranges::find_if(values, [](T delta) { return !(delta >= T(0)); });
        if (refused == values.end()) return;
        const std::int64_t index = refused - values.begin(), samples = deltas.shape(2),
                           rays = deltas.shape(1);
        fail<ValueError>("[", function, "] deltas: interval ", index % samples, " of ray ",
                         index / samples % rays, " has length ", *refused,
                         "; samples must be in order, away from the camera");
    });
}

CompositeWeights composite_weights(const Variable& density, const Tensor& deltas) {
    require_same("composite_weights", density.shape(), deltas.shape());
    require_ordered_samples("composite_weights", deltas);
    const std::int64_t samples = density.shape(2);
    const Variable optical_depth = clamp(density, 0.0, largest_density) * Variable(deltas);
    const Variable transmittance = exp(negate(pad(cumsum(optical_depth, 2), 2, 1, 0)));
    const Variable before = slice(transmittance, 2, 0, samples);
    const Variable behind = slice(transmittance, 2, 1, samples + 1);
    // t_i (1 - exp(-x)) = t_i - t_{i+1} = (t_i + t_{i+1}) tanh(x / 2), because t_{i+1} = t_i
    // exp(-x). Both differences cancel where the density is thin; the product keeps the full
    // relative precision for any x, and tanh does not overflow.
    return {(before + behind) * tanh(optical_depth * 0.5),
            slice(transmittance, 2, samples, samples + 1)};
}

Variable composite(const Variable& weights, const Variable& features) {
    if (weights.rank() != 3 || features.rank() != 3 || weights.shape(0) != features.shape(0) ||
        weights.shape(1) * weights.shape(2) != features.shape(1))
        fail<ShapeError>(
            "[composite] expected weights (cameras, rays, samples) and features (cameras, rays * "
            "samples, channels), got ",
            weights.shape(), " and ", features.shape());
    const std::int64_t cameras = weights.shape(0), rays = weights.shape(1),
                       samples = weights.shape(2), channels = features.shape(2);
    const Variable row_per_ray = reshape(weights, {cameras * rays, 1, samples});
    const Variable features_per_ray = reshape(features, {cameras * rays, samples, channels});
    return reshape(matmul(row_per_ray, features_per_ray), {cameras, rays, channels});
}

Variable composite_depth(const CompositeWeights& weights, const Tensor& depths,
                         double background_depth) {
    require_same("composite_depth", weights.weights.shape(), depths.shape());
    return sum(weights.weights * Variable(depths), {2}) + weights.transmittance * background_depth;
}

Variable depth_variance(const Variable& weights, const Tensor& depths) {
    require_same("depth_variance", weights.shape(), depths.shape());
    const Variable opacity =
        maximum(sum(weights, {2}), Tensor::scalar(least_opacity, weights.dtype()));
    const Variable probability = weights / opacity;
    const Variable distance = Variable(depths) - sum(probability * Variable(depths), {2});
    return mean(sum(probability * square(distance), {2}));
}

}  // namespace stymo
