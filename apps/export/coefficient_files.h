#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "render/morphable/arkit_shapes.h"

namespace stymo {

/// The coefficients of one moment, in the order of `arkit_names`.
using ArkitCoefficients = std::vector<double>;

/// The rows of Live Link Face's CSV (columns Timecode, BlendShapeCount, EyeBlinkLeft, ..., in any
/// order; those of head and eyes are not read), or the one of a .json file {"coefficients":
/// {"eyeBlinkLeft": 0.5, ...}}, where shapes may be left out. Throws FileError, which names the
/// line or key, for another form, for a missing column, and for what is not a number of at least 0.
[[nodiscard]] std::vector<ArkitCoefficients> read_coefficients(const std::filesystem::path& path);

/// Live Link Face's CSV with these rows, a sixtieth of a second apart. Head and eyes are at rest.
[[nodiscard]] std::string live_link_csv(std::span<const ArkitCoefficients> rows);

}  // namespace stymo
