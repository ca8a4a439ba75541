#pragma once

#include <vector>

namespace stymo {

/// The median; for an even number of values, the mean of the two middle ones. Throws ValueError if
/// there are no values.
[[nodiscard]] double median(std::vector<double> values);

}  // namespace stymo
