#pragma once

#include <string>

namespace stymo::view {

/// 128 random bits from the operating system as hexadecimal digits.
[[nodiscard]] std::string random_token();

}  // namespace stymo::view
