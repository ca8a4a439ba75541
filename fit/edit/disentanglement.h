#pragma once

#include <array>

#include "nn/models/codes.h"

namespace stymo {

/// Row: the group that was replaced; column: the group that was read. In the order of `code_names`.
using GroupMatrix = std::array<std::array<double, code_names.size()>, code_names.size()>;

/// How far each group of the codes that an encoder reads moves when one group of the face alone is
/// replaced by another face's. `changed[g]` holds the codes of the images of `base` with group g of
/// `other`, row by row. An entry is the root mean square, over the rows, of the movement of a group
/// from `base`, in units of the same for `other`, where all four are replaced: 1 is as far as to
/// another face, whatever the number of elements of a group and their scale. Throws ShapeError for
/// codes of different shapes, NumericError for a group that does not differ between `base` and
/// `other`.
[[nodiscard]] GroupMatrix group_movements(const Codes& base, const Codes& other,
                                          const std::array<Codes, code_names.size()>& changed);

/// Of each row the largest entry beside the diagonal, relative to the one on it: 0 is perfect
/// disentanglement.
[[nodiscard]] std::array<double, code_names.size()> largest_leaks(const GroupMatrix& movements);

}  // namespace stymo
