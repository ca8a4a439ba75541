#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "apps/view/face_measures.h"
#include "nn/models/code_statistics.h"
#include "nn/models/model.h"
#include "nn/pretrained/landmark_network.h"

namespace stymo {

/// The principal directions of one group of the codes: eigenvectors of its covariance over the
/// training faces, by decreasing variance.
struct GroupDirections {
    /// Each (size of the group); its length is one standard deviation.
    std::vector<Tensor> directions;
    std::vector<double> shares;  ///< share of the group's variance that each direction explains
};

/// The `count` leading directions of each group, in the order of `code_names`; fewer if a group
/// varies in fewer directions. The sign of each direction is chosen so that its element of largest
/// magnitude is positive. Throws ValueError unless `count` is positive.
[[nodiscard]] std::array<GroupDirections, code_names.size()> leading_directions(
    const CodeStatistics& statistics, std::int64_t count);

/// Moves the codes of one face by `amounts[group][i]` standard deviations along direction i of each
/// group. Missing amounts at the end of a group's list are 0. Throws ValueError for more amounts
/// than directions.
[[nodiscard]] Codes moved_along(const Codes& codes, std::span<const GroupDirections> directions,
                                const std::array<std::vector<double>, code_names.size()>& amounts);

/// The names of the directions' ends, by what they change most in frontal pictures of the model's
/// mean face, moved by two standard deviations to either side. Renders two pictures for each
/// direction, and calls `before_each` before each. Throws ValueError for a model without code
/// statistics, NumericError where no landmarks are found.
[[nodiscard]] std::array<std::vector<EndNames>, code_names.size()> direction_names(
    const Model& model, const std::array<GroupDirections, code_names.size()>& directions,
    const LandmarkModel& landmarks, const std::function<void()>& before_each);

}  // namespace stymo
