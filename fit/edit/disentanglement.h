#pragma once

#include <array>

#include "nn/models/codes.h"

namespace stymo {

/// Row: the group that was replaced; column: the group that was measured. In the order of
/// `code_names`.
using GroupMatrix = std::array<std::array<double, code_names.size()>, code_names.size()>;

/// Measures how much each group of an encoder's codes changes if only one group of the face is
/// replaced by that of another face. `base` and `other` are encoded codes; `changed[g]` holds the
/// encoded codes of images of `base` with group g of `other`, row by row. An entry is the root mean
/// square, over the rows, of a group's change from `base`, divided by the same for `other`. So 1
/// means as far as another face, whatever the size and scale of the group. Throws ShapeError for
/// codes of different shapes, NumericError for a group that does not differ between `base` and
/// `other`.
[[nodiscard]] GroupMatrix group_movements(const Codes& base, const Codes& other,
                                          const std::array<Codes, code_names.size()>& changed);

/// For each row, the largest off-diagonal entry divided by the diagonal entry. 0 is perfect
/// disentanglement.
[[nodiscard]] std::array<double, code_names.size()> largest_leaks(const GroupMatrix& movements);

}  // namespace stymo
