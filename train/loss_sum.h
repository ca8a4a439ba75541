#pragma once

#include "core/autograd/variable.h"
#include "core/ops/elementwise.h"

namespace stymo {

/// Adds weight * term() to `total` and sets `report` to the bare term. A term without weight is not even computed.
template <class Term>
void add_term(Variable& total, double& report, double weight, Term term) {
    if (weight == 0.0) return;
    const Variable value = term();
    report = value.value().item();
    total = total + value * weight;
}

}  // namespace stymo
