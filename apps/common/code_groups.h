#pragma once

#include <string>

#include "fit/edit/style_mix.h"

namespace stymo {

/// Parses the value of --take, a list such as "expr,tex". Throws UsageError for an unknown name.
[[nodiscard]] CodeGroups parse_code_groups(const std::string& list);

}  // namespace stymo
