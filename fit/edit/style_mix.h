#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "nn/models/code_file.h"
#include "nn/models/model.h"

namespace stymo {

/// A set of code groups, in the order of `code_names`.
using CodeGroups = std::array<bool, code_names.size()>;

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

}  // namespace stymo
