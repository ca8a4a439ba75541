#pragma once

#include <string>

#include "apps/common/command_line.h"
#include "fit/fitter.h"

namespace stymo {

/// Declares --optimizer.
void declare_fit_optimizer(Command& command, std::string& name);
/// The optimiser of that name.
[[nodiscard]] FitOptimizer fit_optimizer(const std::string& name);

}  // namespace stymo
