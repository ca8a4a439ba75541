#include "fit/morphable/vertex_table.h"

#include <algorithm>
#include <numeric>

#include "core/parallel.h"
#include "fit/morphable/state.h"

namespace stymo::morphable {

namespace {

constexpr std::size_t color_size = 100;

void gather(std::span<const float> basis, std::size_t basis_rows, std::size_t basis_columns,
            std::span<const std::int32_t> vertices, std::size_t row_length, std::size_t first,
            std::span<float> target) {
    parallel_for(
        static_cast<std::int64_t>(vertices.size()), 256, [&](std::int64_t begin, std::int64_t end) {
            for (std::size_t k = 0; k < basis_rows; ++k) {
                for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end);
                     ++i) {
                    const std::size_t source =
                        k * basis_columns + 3 * static_cast<std::size_t>(vertices[i]);
                    for (std::size_t axis = 0; axis < 3; ++axis)
                        target[(3 * i + axis) * row_length + first + k] = basis[source + axis];
                }
            }
        });
}

[[nodiscard]] std::vector<double> linear_model(std::span<const float> mean,
                                               std::span<const float> rows,
                                               std::span<const double> code) {
    std::vector<double> result(mean.begin(), mean.end());
    for (std::size_t i = 0; i < result.size(); ++i) {
        const float* const row = &rows[i * code.size()];
        double sum = 0.0;
#pragma omp simd reduction(+ : sum)
        for (std::size_t k = 0; k < code.size(); ++k) sum += static_cast<double>(row[k]) * code[k];
        result[i] += sum;
    }
    return result;
}

}  // namespace

VertexTable::VertexTable(const MorphableHead& head, std::vector<std::int32_t> chosen)
    : vertices(std::move(chosen)),
      mean(3 * vertices.size()),
      shape(3 * vertices.size() * shape_size),
      mean_albedo(3 * vertices.size()),
      color(3 * vertices.size() * color_size) {
    const auto columns = static_cast<std::size_t>(3 * head.vertex_count());
    gather(head.mean.values<float>(), 1, columns, vertices, 1, 0, mean);
    gather(head.mean_albedo.values<float>(), 1, columns, vertices, 1, 0, mean_albedo);
    gather(head.identity.values<float>(), 100, columns, vertices, shape_size, 0, shape);
    gather(head.expression.values<float>(), 79, columns, vertices, shape_size, 100, shape);
    gather(head.albedo.values<float>(), color_size, columns, vertices, color_size, 0, color);
}

Eigen::Map<const VertexTable::Rows> VertexTable::shape_rows(std::size_t vertex) const {
    return {&shape[3 * vertex * shape_size], 3, shape_size};
}

Eigen::Map<const VertexTable::Rows> VertexTable::color_rows(std::size_t vertex) const {
    return {&color[3 * vertex * color_size], 3, color_size};
}

std::vector<double> table_points(const VertexTable& table, std::span<const double> state) {
    return linear_model(table.mean, table.shape, state.subspan(identity_begin, shape_size));
}

std::vector<double> table_albedo(const VertexTable& table, std::span<const double> state) {
    return linear_model(table.mean_albedo, table.color, state.subspan(texture_begin, color_size));
}

}  // namespace stymo::morphable
