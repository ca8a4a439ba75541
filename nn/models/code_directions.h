#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "nn/models/code_statistics.h"

namespace stymo {

/// The principal directions of one group of the codes: eigenvectors of its covariance over the
/// training faces, those of the largest variance first.
struct GroupDirections {
    std::vector<Tensor>
        directions;              ///< each (size of the group), as long as one standard deviation
    std::vector<double> shares;  ///< of the group's variance, for each direction
};

/// The `count` leading directions of each group, in the order of `code_names`; fewer where a group
/// varies in fewer. The sign of a direction is such that its element of largest magnitude is
/// positive. Throws ValueError unless `count` is positive.
[[nodiscard]] std::array<GroupDirections, code_names.size()> leading_directions(
    const CodeStatistics& statistics, std::int64_t count);

/// The codes of one face moved by `amounts[group][i]` standard deviations along direction i of each
/// group; amounts that are missing at the end are 0. Throws ValueError for more amounts than
/// directions.
[[nodiscard]] Codes moved_along(const Codes& codes, std::span<const GroupDirections> directions,
                                const std::array<std::vector<double>, code_names.size()>& amounts);

}  // namespace stymo
