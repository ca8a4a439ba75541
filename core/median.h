#pragma once

#include <algorithm>
#include <vector>

#include "core/error.h"

namespace stymo {

/// The median; for an even number of values, the mean of the two middle ones. Throws ValueError if
/// there are no values.
[[nodiscard]] inline double median(std::vector<double> values) {
    if (values.empty()) fail<ValueError>("[median] there are no values");
    std::ranges::sort(values);
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

}  // namespace stymo
