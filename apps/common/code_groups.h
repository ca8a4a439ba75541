#pragma once

#include <string>

#include "fit/edit/style_mix.h"

namespace stymo {

/// Parses a list such as "expr,tex" of --take. Throws UsageError for an unknown name.
[[nodiscard]] CodeGroups parse_code_groups(const std::string& list);

}  // namespace stymo
