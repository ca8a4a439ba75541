#include "nn/models/significant_rows.h"

#include "core/ops/elementwise.h"
#include "core/ops/shape_ops.h"

namespace stymo {

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
