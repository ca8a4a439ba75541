#include "apps/common/fit_optimizer.h"

namespace stymo {

void declare_fit_optimizer(Command& command, std::string& name) {
    command
        .option("--optimizer", name,
                "adam (the paper's) or lbfgs, which reaches the same loss in fewer steps; a step "
                "is one evaluation of loss and gradient")
        .one_of({"adam", "lbfgs"});
}

FitOptimizer fit_optimizer(const std::string& name) {
    return name == "lbfgs" ? FitOptimizer::lbfgs : FitOptimizer::adam;
}

}  // namespace stymo
