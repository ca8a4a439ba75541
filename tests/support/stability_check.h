#pragma once

#include <catch2/catch.hpp>
#include <sstream>

#include "cases/stability/case.h"

namespace stymo::stability {

/// Checks that each case is finite and within its bounds, or is refused with the right error. With
/// Catch's option -s each case says what it does and how far its numbers are from float64.
inline void check(const std::vector<StabilityCase>& cases) {
    for (const StabilityCase& row : cases) {
        const StabilityOutcome outcome = run_stability_case(row);
        std::ostringstream text;
        text << row.name << ": " << row.behaviour;
        if (outcome.value_error)
            text << "; value " << *outcome.value_error << " of " << row.value_bound;
        if (outcome.gradient_error)
            text << "; gradient " << *outcome.gradient_error << " of " << row.gradient_bound;
        INFO(text.str());
        CHECK(outcome.failure == "");
    }
}

}  // namespace stymo::stability
