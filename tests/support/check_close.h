#pragma once

#include <string>
#include <vector>

#include "core/tensor.h"

namespace stymo::test {

struct CloseReport {
    bool passed = false;
    double error = 0.0;   ///< largest difference, divided by the largest magnitude in `expected`
    std::string message;  ///< one line: where the two differ most, and by how much
};

/// Compares shapes, then elements: every difference must be at most `tolerance` times the largest
/// magnitude in `expected` (or times 1e-3 if that is larger, so that zeros may be compared).
/// Not-a-number never passes.
[[nodiscard]] CloseReport check_close(const Tensor& actual, const Tensor& expected,
                                      double tolerance);

/// True if type, shape and every bit agree.
[[nodiscard]] bool identical(const Tensor& a, const Tensor& b);
[[nodiscard]] bool all_identical(const std::vector<Tensor>& a, const std::vector<Tensor>& b);

}  // namespace stymo::test
