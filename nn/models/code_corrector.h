#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/rng.h"
#include "nn/layers/linear.h"
#include "nn/models/codes.h"
#include "nn/parameter_store.h"

namespace stymo {

/// Turns gradients of errors with respect to codes into a correction of the codes, as learnt
/// gradient descent does (Song et al. 2020, "Human Body Model Fitting by Learned Gradient
/// Descent"). What the errors are, nn/models/code_correction.h says. Its parameters are named
/// `prefix`.*.
class CodeCorrector {
public:
    /// `errors`: the number of gradients that it reads. The first corrections are 0.
    CodeCorrector(ParameterStore& store, const std::string& prefix, std::int64_t errors, Rng& rng);

    /// Codes (B, 306) after one correction, from one gradient (B, 306) for each error. Gradients
    /// flow to the parameters and to the codes to which the correction is added. Throws ShapeError
    /// for another number of gradients.
    [[nodiscard]] Variable operator()(const Variable& codes,
                                      std::span<const Tensor> gradients) const;

private:
    std::int64_t errors_;
    Linear preconditioner_;  ///< of the gradients, at their length
    Linear wide_;            ///< reads directions and lengths of the gradients, and the codes
    Linear narrow_;
    Linear last_;
};

}  // namespace stymo
