#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "nn/models/code_file.h"
#include "nn/models/codes.h"
#include "nn/models/model.h"

namespace stymo {

/// A set of code groups, in the order of `code_names`.
using CodeGroups = std::array<bool, code_names.size()>;

/// The groups of a list such as "expr,tex". Throws ValueError for an unknown name.
[[nodiscard]] CodeGroups code_groups_of(const std::string& list);

/// The target's codes in Z, with the groups `taken` replaced by the source's. (The paper swaps the
/// two names.) Throws ShapeError unless both have the same number of rows.
[[nodiscard]] Codes mix_codes(const Codes& target, const Codes& source, const CodeGroups& taken);

/// The paper's figure of style mixing: sources in the left column, targets in the top row, and in
/// each cell the target's face, in its own pose, with the block's groups taken from the source. The
/// sheet has one block for each of `blocks`, side by side with a gap of one tile. Throws ValueError
/// without sources, targets or blocks.
[[nodiscard]] Tensor mixing_sheet(const Model& model, std::span<const CodeFile> sources,
                                  std::span<const CodeFile> targets,
                                  std::span<const CodeGroups> blocks, std::int64_t samples_per_ray);

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
/// disentanglement. Throws NumericError for a diagonal entry that is not positive.
[[nodiscard]] std::array<double, code_names.size()> largest_leaks(const GroupMatrix& movements);

}  // namespace stymo
