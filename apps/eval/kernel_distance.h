#pragma once

#include <vector>

namespace stymo {

/// Kernel Inception Distance (Binkowski et al. 2018) for features of any network: the unbiased
/// estimate of the squared maximum mean discrepancy between two sets of features, with the kernel
/// (x.y / d + 1)^3 for features of d numbers. For two sets from the same distribution its
/// expectation is 0, so it may be negative. Throws ValueError unless both sets have at least two
/// features and all features have the same length.
[[nodiscard]] double kernel_distance(const std::vector<std::vector<double>>& a,
                                     const std::vector<std::vector<double>>& b);

}  // namespace stymo
