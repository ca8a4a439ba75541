#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/autograd/variable.h"

namespace stymo::test {

using GradFunction = std::function<Variable(const std::vector<Variable>&)>;

struct CheckGradOptions {
    int order = 2;       ///< highest order of derivative that is checked
    double step = 1e-3;  ///< in units of the inputs; a kink must be more than twice as far away
    double tolerance = 1e-6;               ///< relative to the derivative in the drawn direction
    std::uint64_t seed = 1;                ///< of the cotangents and directions
    std::vector<std::size_t> constants{};  ///< inputs that no gradient is asked of
};

struct GradReport {
    bool passed = true;
    double worst_error = 0.0;  ///< largest relative error of all inputs and orders
    std::string message;  ///< what failed: op, order, input, seed, both numbers, every element if
                          ///< there are few
};

/// Compares gradients with central differences (five points, error of order step^4) in float64.
///
/// The function's value is contracted with a random cotangent; the derivative of that number along
/// one random direction for each input must agree. Order 2 checks, in the same way, the gradient as
/// a function of the inputs and of the cotangent, order 3 the gradient of that, and so on; the
/// check stops at the first order that fails. Throws TypeError for an input that is not float64.
[[nodiscard]] GradReport check_grad(const std::string& name, const GradFunction& function,
                                    const std::vector<Tensor>& inputs,
                                    const CheckGradOptions& options = {});

}  // namespace stymo::test
