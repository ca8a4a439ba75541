#include "apps/eval/kernel_distance.h"

#include <algorithm>
#include <numeric>

#include "core/error.h"

namespace stymo {

namespace {

using Features = std::vector<std::vector<double>>;

double kernel(const std::vector<double>& x, const std::vector<double>& y) {
    const double dot = std::inner_product(x.begin(), x.end(), y.begin(), 0.0);
    const double base = dot / static_cast<double>(x.size()) + 1.0;
    return base * base * base;
}

/// Mean of the kernel over the pairs of different features.
double mean_within(const Features& set) {
    double sum = 0.0;
    for (std::size_t i = 0; i < set.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) sum += 2.0 * kernel(set[i], set[j]);
    const auto count = static_cast<double>(set.size());
    return sum / (count * (count - 1.0));
}

double mean_between(const Features& a, const Features& b) {
    double sum = 0.0;
    for (const std::vector<double>& x : a)
        for (const std::vector<double>& y : b) sum += kernel(x, y);
    return sum / (static_cast<double>(a.size()) * static_cast<double>(b.size()));
}

}  // namespace

double kernel_distance(const Features& a, const Features& b) {
    if (a.size() < 2 || b.size() < 2)
        fail<ValueError>("a kernel distance needs at least two features of each set");
    for (const Features* set : {&a, &b})
        if (std::ranges::any_of(
                *set, [&](const std::vector<double>& x) { return x.size() != a.front().size(); }))
            fail<ValueError>("features of different lengths cannot be compared");
    return mean_within(a) + mean_within(b) - 2.0 * mean_between(a, b);
}

}  // namespace stymo
