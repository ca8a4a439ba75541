#include "render/continued_colors.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <vector>

#include "core/error.h"
#include "core/tensor_eigen.h"

namespace stymo {

Tensor continued_colors(const Tensor& seen,
                        std::span<const std::array<std::int32_t, 3>> triangles) {
    if (seen.rank() != 2 || seen.shape(1) != 4)
        fail<ShapeError>("[continued_colors] colours are (V, 4), not ", seen.shape());
    constexpr double smoothness = 1e-3;
    constexpr double of_mean = 1e-9;  // for pieces without any weight
    const auto given = matrix_map<float>(seen);
    const Eigen::Index count = given.rows();
    const Eigen::VectorXd weights = given.col(3).cast<double>();
    const Eigen::MatrixXd weighted =
        given.leftCols(3).cast<double>().array().colwise() * weights.array();
    const Eigen::RowVectorXd mean = weighted.colwise().sum() / (weights.sum() + 1e-12);

    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index i = 0; i < count; ++i)
        entries.emplace_back(static_cast<int>(i), static_cast<int>(i), weights[i] + of_mean);
    // An edge inside a surface belongs to two triangles.
    for (const std::array<std::int32_t, 3>& triangle : triangles)
        for (std::size_t k = 0; k < 3; ++k) {
            const std::int32_t a = triangle[k], b = triangle[(k + 1) % 3];
            entries.emplace_back(a, a, 0.5 * smoothness);
            entries.emplace_back(b, b, 0.5 * smoothness);
            entries.emplace_back(a, b, -0.5 * smoothness);
            entries.emplace_back(b, a, -0.5 * smoothness);
        }
    Eigen::SparseMatrix<double> system(count, count);
    system.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(system);
    const Eigen::MatrixXd colors = solver.solve(weighted.rowwise() + of_mean * mean);

    Tensor result({seen.shape(0), 3});
    mutable_matrix_map<float>(result) = colors.cast<float>();
    return result;
}

}  // namespace stymo
