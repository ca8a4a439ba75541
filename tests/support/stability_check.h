#pragma once

#include <catch2/catch.hpp>

#include "apps/cases/stability/case.h"

namespace stymo::stability {

/// Checks that each case is finite and within its bounds, or is refused with the right error.
inline void check(const std::vector<StabilityCase>& cases) {
    for (const StabilityCase& row : cases) {
        INFO(row.name);
        CHECK(run_stability_case(row).failure == "");
    }
}

}  // namespace stymo::stability
