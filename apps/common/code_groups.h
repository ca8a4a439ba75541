#pragma once

#include <string>

#include "fit/edit/style_mix.h"

namespace stymo {

/// "expr,tex" of --take. Throws UsageError for a name that no group of codes has.
[[nodiscard]] CodeGroups parse_code_groups(const std::string& list);

}  // namespace stymo
