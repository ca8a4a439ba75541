#pragma once

#include <string>

namespace stymo {

/// The name of this machine in its network, for messages; "unknown host" if it has none.
[[nodiscard]] std::string host_name();

}  // namespace stymo
