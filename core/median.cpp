#include "core/median.h"

#include <algorithm>

#include "core/error.h"

namespace stymo {

double median(std::vector<double> values) {
    if (values.empty()) fail<ValueError>("[median] there are no values");
    std::ranges::sort(values);
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

}  // namespace stymo
