#include "apps/view/code_directions.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/tensor_eigen.h"
#include "fit/photo/landmarks.h"
#include "nn/realtime/face_renderer.h"

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

std::array<std::vector<EndNames>, code_names.size()> direction_names(
    const Model& model, const std::array<GroupDirections, code_names.size()>& directions,
    const LandmarkModel& landmarks, const std::function<void()>& before_each) {
    if (!model.code_statistics()) fail<ValueError>("this model has no statistics of codes");
    constexpr double deviations = 2.0;
    constexpr std::int64_t least_samples = 8, largest_side = 128;
    const std::int64_t side = std::min(model.config().decoder.resolution, largest_side);
    const Codes mean =
        split_codes(Variable(model.code_statistics()->mean().reshaped({1, code_size})));
    const std::int64_t samples =
        std::max(model.config().reconstruction.fit_samples_per_ray / 2, least_samples);
    FaceRenderer renderer(model, {.mode = RenderMode::exact,
                                  .samples_per_ray = samples,
                                  .resolution = side,
                                  .mask = true,
                                  .remove_floaters = true});
    const Camera camera = model_camera(model, 0.0, 0.0, 0.0);
    const auto picture = [&](const Codes& codes) {
        before_each();
        renderer.show(codes);
        return renderer.render(camera);
    };
    // All in one square: what differs is then the face alone.
    const FaceSquare square = square_around(find_points(
        landmarks, picture(mean).image, square_around(mean_face_landmarks(camera, side))));
    const auto measured = [&](std::size_t group, std::size_t direction, double amount) {
        std::array<std::vector<double>, code_names.size()> amounts;
        amounts[group].resize(direction + 1);
        amounts[group][direction] = amount;
        const View view = picture(moved_along(mean, directions, amounts));
        return face_measures(view.image, view.mask,
                             points_in_squares(landmarks, view.image, {square}));
    };
    std::vector<std::vector<double>> changes;
    std::vector<std::size_t> groups;
    for (std::size_t group = 0; group < directions.size(); ++group)
        for (std::size_t d = 0; d < directions[group].directions.size(); ++d) {
            std::vector<double> change = measured(group, d, deviations);
            const std::vector<double> less = measured(group, d, -deviations);
            std::ranges::transform(change, less, change.begin(), std::minus());
            changes.push_back(change);
            groups.push_back(group);
        }
    std::array<std::vector<EndNames>, code_names.size()> names;
    const std::vector<EndNames> all = names_of_changes(changes, groups);
    for (std::size_t i = 0; i < all.size(); ++i) names[groups[i]].push_back(all[i]);
    return names;
}

}  // namespace stymo
