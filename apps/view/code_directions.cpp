#include "apps/view/code_directions.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/tensor_eigen.h"

namespace stymo {

namespace {

/// Directions with a smaller share of the group's variance are rounding errors.
constexpr double least_share = 1e-9;

GroupDirections directions_of(const Eigen::MatrixXd& covariance, std::int64_t count) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
    const Eigen::VectorXd& variances = solver.eigenvalues();  // ascending
    const double all = variances.cwiseMax(0.0).sum();
    GroupDirections result;
    for (Eigen::Index i = variances.size() - 1; i >= 0 && std::ssize(result.shares) < count; --i) {
        if (!(variances[i] > least_share * all)) break;
        Eigen::VectorXd direction = std::sqrt(variances[i]) * solver.eigenvectors().col(i);
        Eigen::Index largest = 0;
        direction.cwiseAbs().maxCoeff(&largest);
        if (direction[largest] < 0.0) direction = -direction;
        const std::span<const double> elements(direction.data(),
                                               static_cast<std::size_t>(direction.size()));
        result.directions.push_back(Tensor::from({direction.size()}, elements).to(DType::float32));
        result.shares.push_back(variances[i] / all);
    }
    return result;
}

}  // namespace

std::array<GroupDirections, code_names.size()> leading_directions(const CodeStatistics& statistics,
                                                                  std::int64_t count) {
    if (count < 1) fail<ValueError>("there must be at least one direction, got ", count);
    const std::vector<double> elements = statistics.factor().to_vector();
    const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>
        factor(elements.data(), code_size, code_size);
    std::array<GroupDirections, code_names.size()> result;
    Eigen::Index first = 0;
    for (std::size_t group = 0; group < result.size(); ++group) {
        const auto rows = factor.middleRows(first, code_sizes[group]);
        result[group] = directions_of(rows * rows.transpose(), count);
        first += code_sizes[group];
    }
    return result;
}

Codes moved_along(const Codes& codes, std::span<const GroupDirections> directions,
                  const std::array<std::vector<double>, code_names.size()>& amounts) {
    Codes result = codes;
    for (std::size_t group = 0; group < amounts.size(); ++group) {
        if (amounts[group].size() > directions[group].directions.size())
            fail<ValueError>(code_names[group], " has ", directions[group].directions.size(),
                             " directions, not ", amounts[group].size());
        Tensor moved = codes.groups[group].value();
        const std::span<float> elements = moved.mutable_values<float>();
        for (std::size_t i = 0; i < amounts[group].size(); ++i) {
            const auto direction = directions[group].directions[i].values<float>();
            for (std::size_t k = 0; k < elements.size(); ++k)
                elements[k] += static_cast<float>(amounts[group][i]) * direction[k];
        }
        result.groups[group] = Variable(moved);
    }
    return result;
}

}  // namespace stymo
