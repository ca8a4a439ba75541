#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "nn/models/code_file.h"
#include "nn/models/model.h"

namespace stymo {

/// Which groups of a code are meant, in the order of `code_names`.
using CodeGroups = std::array<bool, code_names.size()>;

/// The target's codes in Z with the groups that are taken from the source. (The paper calls the two
/// the other way round.) Throws ShapeError unless both have as many rows.
[[nodiscard]] Codes mix_codes(const Codes& target, const Codes& source, const CodeGroups& taken);

/// The paper's figure of style mixing: sources down the left, targets across the top, and at each
/// place the target's face, in its own pose, with what the block takes from the source. One block
/// for each of `blocks`, side by side with a gap of one tile. Throws ValueError without sources,
/// targets or blocks.
[[nodiscard]] Tensor mixing_sheet(const Model& model, std::span<const CodeFile> sources,
                                  std::span<const CodeFile> targets,
                                  std::span<const CodeGroups> blocks, std::int64_t samples_per_ray);

}  // namespace stymo
