#include "nn/models/significant_rows.h"

#include <algorithm>

#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"

namespace stymo {

Tensor significant_samples(const Tensor& weights, double tolerance) {
    Tensor result(weights.shape(), weights.dtype());
    dispatch(weights.dtype(), [&]<class T>(T) {
        std::ranges::transform(
            weights.values<T>(), result.mutable_values<T>().begin(),
            [=](T weight) { return weight >= static_cast<T>(tolerance) ? T(1) : T(0); });
    });
    return result;
}

RowIndices significant_rows(const RayPoints& rays, std::int64_t index) {
    const std::int64_t count = rays.deltas.shape(1) * rays.deltas.shape(2);
    RowIndices rows;
    const std::vector<double> kept =
        rays.significant.defined() ? rays.significant.to_vector() : std::vector<double>();
    for (std::int64_t i = 0; i < count; ++i)
        if (kept.empty() || kept[static_cast<std::size_t>(index * count + i)] != 0.0)
            rows.push_back(i);
    return rows;
}

RenderedRays composited_rows(const Variable& samples, const RowIndices& rows,
                             const Tensor& deltas) {
    const std::int64_t count = deltas.size(), per_ray = deltas.shape(2);
    const Variable density = scatter_add_rows(slice(samples, 1, 0, 1), rows, count);
    const CompositeWeights weights = composite_weights(reshape(density, deltas.shape()), deltas);
    const Variable counting = gather_rows(reshape(weights.weights, {count, 1}), rows);
    RowIndices ray_of_row;
    for (const std::int64_t row : rows) ray_of_row.push_back(row / per_ray);
    const Variable sums = scatter_add_rows(counting * slice(samples, 1, 1, samples.shape(1)),
                                           std::move(ray_of_row), deltas.shape(1));
    return {weights, reshape(sums, {1, deltas.shape(1), sums.shape(1)})};
}

}  // namespace stymo
