#pragma once

#include <vector>

namespace stymo {

/// The mean of the two middle values of an even number. Throws ValueError for no values.
[[nodiscard]] double median(std::vector<double> values);

}  // namespace stymo
