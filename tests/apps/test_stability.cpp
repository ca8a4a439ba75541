#include <catch2/catch.hpp>
#include <set>

#include "apps/bench/report/stability_case.h"

using namespace stymo;

TEST_CASE("every case of the stability report is finite within its bound, or refused with an error that names the tensor",
          "[stability]") {
    std::set<std::string> names;
    for (const StabilityCase& row : stability_cases()) {
        INFO(row.name);
        CHECK(names.insert(row.name).second);
        CHECK(run_stability_case(row).failure == "");
    }
}
